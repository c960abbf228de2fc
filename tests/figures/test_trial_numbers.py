"""What is read from trials: those without a number stay in sight and are never zeros."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from evoclaims.figures.trial_numbers import COLUMNS, absences, frame, read


def _read(paper: Any, method: str = "one", task: str = "small") -> Any:
    return read(paper.scope, method, task, lambda trials: trials.last_success)


def test_a_trial_without_a_number_has_a_status_and_no_value(paper: Any) -> None:
    paper.put("one", "small", {0: 0.5, 1: (0.0, "diverged"), 2: (0.0, "timeout"), 3: (0.0, "crashed"), 4: math.nan})
    found = _read(paper)
    assert [r.status for r in found.each[:5]] == ["done", "diverged", "timeout", "crashed", "not finite"]
    assert [r.status for r in found.each[5:]] == ["not run"] * 5
    assert [r.value for r in found.each] == [0.5, *[None] * 9]
    assert [r.rank for r in found.each] == [0.5, -math.inf, -math.inf, *[None] * 7]
    assert (found.values, found.ranks, found.broken) == ((0.5,), (0.5, -math.inf, -math.inf), 4)
    paper.put("one", "large", [math.inf])
    number = read(paper.scope, "one", "large", lambda trials: trials.reward).each[0]
    assert (number.status, number.value, number.rank) == ("not finite", None, math.inf)


def test_absences_are_said_once_a_condition(paper: Any) -> None:
    paper.put("one", "small", {0: 1.0, 1: (0.0, "diverged"), 2: math.nan})
    paper.put("one", "large", [1.0] * 10)
    found = [_read(paper), _read(paper), _read(paper, "one", "large"), _read(paper, "other", "large")]
    assert absences(found) == (
        "Not run: other on large.",
        "Run in part: one on small (3 of 10 trials).",
        "one on small: 1 of 10 trials diverged (no value; the worst rank in tests).",
        "one on small: 1 of 10 trials ended with a number that is not finite (left out of the mean).",
    )
    assert absences([_read(paper, "one", "large")]) == ()


def test_the_table_has_a_row_for_every_seed_and_one_for_their_mean(paper: Any) -> None:
    values = [0.1, 0.2, 0.7, 1.0]
    paper.put("one", "small", [*values, (0.0, "diverged")])
    table = frame(_read(paper).rows(panel="p", at="0", series="The One"))
    assert tuple(table.columns) == COLUMNS
    trials = table[table["what"] == "trial"]
    assert list(trials["seed"]) == list(range(10))
    assert list(trials["value"].dropna()) == pytest.approx(values)
    (mean,) = table[table["what"] == "mean"].to_dict("records")
    assert (mean["n"], mean["value"]) == (4, pytest.approx(np.mean(values), rel=1e-12))
    assert mean["error"] == pytest.approx(np.std(values, ddof=1), rel=1e-12)
    assert "mean" not in set(frame(_read(paper, "other").rows())["what"])
