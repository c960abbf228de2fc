"""Reports of claims as JSON: nothing is lost on the way to a file or another process, and older files are read."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest
from hand_made_verdicts import evidence, report, verdict

from evoclaims.judging.sample import Sample
from evoclaims.judging.verdict import Bound, Interval
from evoclaims.verdicts.claim_report import Attainable, ClaimReport
from evoclaims.verdicts.source_trials import SourceTrials

OLDER = Path(__file__).with_name("verdict_of_0.1.0.json")
"""What version 0.1.0 wrote, before evidence had bounds."""

PART = evidence(
    0.25,
    samples=(Sample("a: x", (0, 1), (1.0, -math.inf), -math.inf, (1,), ("diverged",)),),
    intervals=(Interval("median", -math.inf, math.inf, on_axis=True),),
    bounds=(Bound("lowest", 0.5), Bound("margin", 1.0, on_axis=False)),
    events=True,
)
WHOLE = report(
    "G1",
    "refuted",
    case="n_parity",
    expected="refuted",
    verdict=verdict("refuted", evidence=(PART, evidence(None)), deciding=1),
    sources=(SourceTrials("a", "b", "c" * 64, ("d" * 64,), {"jax": ("0.10.2",), "qdax": (None, "0.5")}, (3,)),),
    attainable=(Attainable(5, 0.01, 0.004, 0.5),),
)


@pytest.mark.parametrize("one", [WHOLE, report("G2", "error", verdict=None)])
def test_a_report_crosses_processes_as_json_unchanged(one: ClaimReport) -> None:
    assert ClaimReport.from_json(json.loads(json.dumps(one.to_json(), allow_nan=False))) == one


def test_the_json_is_made_of_built_in_types_alone() -> None:
    def types(value: Any) -> set[type]:
        inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
        return {type(value)}.union(*map(types, inner))

    assert types(WHOLE.to_json()) == {dict, list, str, int, float, bool, type(None)}
    assert WHOLE.to_json()["verdict"]["evidence"][0]["samples"][0]["values"] == [1.0, "-inf"]


@pytest.mark.parametrize(
    "torn", [{"outcome": "won"}, {"verdict": {}}, {"attainable": [{"n": 3}]}, {"sources": [{"method": "a"}]}]
)
def test_what_is_no_report_is_refused(torn: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=rf"\$\.{next(iter(torn))}"):
        ClaimReport.from_json({**WHOLE.to_json(), **torn})


def test_a_file_of_an_earlier_release_is_read() -> None:
    older = ClaimReport.from_json(json.loads(OLDER.read_text()))
    assert older.verdict is not None
    assert older.verdict.evidence[0].samples[1].values == (0.1, 0.2, -math.inf)
