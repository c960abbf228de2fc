"""The vocabulary has every measure and every kind of assertion, written as claims write them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, ClassVar

import pytest
from hand_made_paper import CONDITIONS

from evoclaims import Event, Measure, Profile, TrialGroup
from evoclaims.judging.assertion import AllOf, AnyOf, Assertion
from evoclaims.judging.kinds.most_trials import MostTrials
from evoclaims.report.vocabulary import assertions, declared_kinds, measures

PAGE = (Path(__file__).parents[2] / "docs" / "vocabulary.md").read_text(encoding="utf-8")
GROUPS = {
    name: TrialGroup(name, "small", condition, lambda *_: [])
    for name, condition in zip("abc", CONDITIONS.values(), strict=False)
}


def every_kind(of: type[Assertion] = Assertion) -> set[type[Assertion]]:
    """Return the kinds of the package."""
    kinds = {kind for one in of.__subclasses__() for kind in (one, *every_kind(one))}
    return {kind for kind in kinds if kind.__module__.startswith("evoclaims.") and hasattr(kind, "kind")}


def test_every_kind_has_an_entry_and_a_section() -> None:
    found = set(declared_kinds())
    assert found == every_kind() - {MostTrials}
    assert {AllOf, AnyOf} < found
    assert re.findall(r"^### (.*)$", assertions(), re.MULTILINE)[-2:] == ["all of", "any of"]
    assert re.findall(r"^### (.*)$", PAGE, re.MULTILINE) == re.findall(r"^### (.*)$", assertions(), re.MULTILINE)


@pytest.mark.parametrize("kind", sorted(declared_kinds(), key=lambda kind: kind.kind), ids=lambda kind: kind.kind)
def test_what_the_vocabulary_shows_makes_that_kind(kind: type[Assertion]) -> None:
    assert kind.entry is not None
    for written in kind.entry.syntax:
        assert type(eval(written, dict(GROUPS))) is kind, written


def test_every_measure_is_in_the_table_with_what_it_reads() -> None:
    rows = dict(re.findall(r"^\| `a\.(\w+)(?:\(.*?\))?` \| ([^|]*) \|", measures(TrialGroup), re.MULTILINE))
    classes: dict[str, Any] = {"a number": Measure, "true or false": Event, "a number per level": Profile}
    made = {name: type(getattr(GROUPS["a"], name)) for name, v in vars(TrialGroup).items() if isinstance(v, property)}
    measured = {name: kind for name, kind in made.items() if kind in classes.values()}
    assert len(measured) > 8
    assert measured == {name: classes[rows[name]] for name in rows if name in made}
    assert {"steps_to", "solves_level"} < set(rows)
    assert "| `factor * a.reward` | a number |" in measures(TrialGroup)


def test_a_papers_own_measures_have_a_table_of_their_own() -> None:
    class Own(TrialGroup):
        unknown: ClassVar[int] = 1

        @property
        def haste(self) -> Measure:
            """Either | or.

            Raises:
                Nothing: ever.
            """
            raise NotImplementedError

        @property
        def unannotated(self):  # type: ignore[no-untyped-def]
            """Of a guide."""

        def helper(self) -> int:
            """Return no measure."""
            return 1

    generic, _, own = measures(Own).partition("This paper's own (`Own`):")
    assert "| `a.haste` | a number | Either \\| or. |" in own
    assert "| `a.unannotated` |  | Of a guide. |" in own
    assert "helper" not in own
    assert "a.reward" not in own
    assert generic.strip() == measures(TrialGroup).strip()
