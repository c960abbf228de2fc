"""The power that stands beside an inconclusive verdict."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hand_made_verdicts import evidence, report, verdict
from laboratory import Laboratory

from evoclaims.judging.design import Design, Look
from evoclaims.judging.power import RATES, event_power
from evoclaims.judging.verdict import Bound, Outcome
from evoclaims.report.table_cells import power
from evoclaims.verdicts.claim_report import Attainable

LOOKS = (Attainable(5, 0.01, 0.004, 0.5), Attainable(10, 0.04, 1e-5, 0.5))


def test_the_power_of_open_comparisons_is_shown_and_of_no_other_part() -> None:
    open_, margin = Outcome.INCONCLUSIVE, (Bound("A12 margin", 0.71, on_axis=False),)
    parts = (
        evidence(outcome=open_, bounds=margin),
        evidence(describe="c > d", bounds=margin),  # is supported
        evidence(kind="equivalent", outcome=open_, bounds=margin),
    )
    shown = report(outcome="inconclusive", verdict=verdict("inconclusive", evidence=parts), attainable=LOOKS)
    assert power(shown) == (
        "“a > b” is supported by 10 trials with probability 0.44, 0.75, 0.97 at an A12 of 0.71, 0.8, 0.9"
    )
    assert power(report(verdict=verdict(evidence=parts), attainable=LOOKS)) == ""


@pytest.mark.parametrize(
    ("joined", "alpha"), [(lambda a, b: a, 0.05), (lambda a, b: a & b, 0.05), (lambda a, b: a | b, 0.025)]
)
def test_alternatives_share_alpha(tmp_path: Path, joined: Any, alpha: float) -> None:
    lab, names = Laboratory(tmp_path, Design.fixed(10)), ("better", "worse")
    for name in names:
        lab.put(name, [1.0] * 7 + [0.0] * 3)
    judged = lab.judge(
        lambda of: joined(*(of(m).last_success_is(1).in_most_trials(p0=0.6) for m in ("better", "worse")))
    )
    chances = ", ".join(f"{event_power([Look(10, alpha)], 0.6, rate):.2f}" for rate in RATES)
    assert f"is supported with probability {chances} at true rates of" in power(judged)
