"""Tables of settings: read from the conditions, and marked where they differ from the paper's."""

from __future__ import annotations

from typing import Any

import pytest
from small_paper import collisions, told, words

from evoclaims.core.errors import UserError
from evoclaims.figures.listing import Block, Listing
from evoclaims.paper.reported import Published

PUBLISHED = Published({}, {"one": {"place": "Table 1", "values": {"bits": 3, "generations": 5000, "kind": "parity"}}})
SETTINGS = {
    "bits": lambda condition: condition.task.bits,
    "generations": lambda condition: condition.budget.generations,
    "kind": lambda condition: "parity",
    "share": lambda condition: 0.25,
}


def test_settings_stand_beside_the_papers_and_are_marked_where_they_differ(paper: Any) -> None:
    drawing = paper.draw(Listing((Block("The One", "one", "small", "one", SETTINGS),), PUBLISHED, ("A remark.",)))
    assert drawing.table.to_dict("records") == [
        {"table": "The One", "setting": "bits", "paper": "3", "full": "3"},
        {"table": "The One", "setting": "generations", "paper": "5,000", "full": "2"},
        {"table": "The One", "setting": "kind", "paper": "parity", "full": "parity"},
        {"table": "The One", "setting": "share", "paper": "", "full": "0.25"},
    ]
    shown = words(drawing)
    assert (shown.count("3"), shown.count("2 ≠"), shown.count("0.25"), shown.count("–")) == (2, 1, 1, 1)
    assert "paper: Table 1" in shown
    assert "A remark." in told(drawing)
    assert (drawing.shown, drawing.missing) == (4, ())


def test_a_published_value_that_is_left_out_is_an_error(paper: Any) -> None:
    few = {"bits": SETTINGS["bits"]}
    with pytest.raises(UserError, match="'The One' leaves out what the paper has published: generations, kind"):
        paper.draw(Listing((Block("The One", "one", "small", "one", few),), PUBLISHED))


def test_long_settings_are_broken_into_lines(paper: Any) -> None:
    long = {**SETTINGS, "kind": lambda condition: "parity of " + "all the bits " * 20}
    drawing = paper.draw(Listing((Block("The One", "one", "small", "one", long),) * 2, PUBLISHED, width=4.0))
    assert collisions(drawing) == []
