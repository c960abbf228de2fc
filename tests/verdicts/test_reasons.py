"""Why a verdict may differ from the accepted one: what is found out tells a change of the code from chance."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hand_made_verdicts import report

from evoclaims.judging.drift_report import DigestChange, DigestCheck, DriftReport, DriftRow
from evoclaims.judging.verdict import Outcome
from evoclaims.verdicts.history import AcceptedVerdict
from evoclaims.verdicts.regression import reason
from evoclaims.verdicts.source_trials import SourceTrials

REPORT = replace(report(), sources=(SourceTrials("a", "t", "c" * 64, ("1",), {}, ()),))
OLD = AcceptedVerdict(
    outcome=Outcome.REFUTED,
    reason="",
    n=10,
    p=0.04,
    fingerprint="f",
    accepted="2026-01-01",
    versions={"jax": "0.11.2"},
    device="H200",
    revision="",
    trials="1",
)
NEW = replace(OLD, outcome=Outcome.SUPPORTED, p=0.06, versions={"jax": "0.10.2"}, device="cpu", trials="2")
FINE = DriftRow("a on t (smoke)", "reward", 10, 10, "no drift", 0.5, 0.7, a12=0.6, median_new=2.0, median_ref=1.0)
ELSEWHERE = replace(FINE, label="b on t (smoke)", status="drift")
SAME = DigestCheck(10, ())


def _why(
    new: AcceptedVerdict = NEW, rows: tuple[DriftRow, ...] = (FINE, ELSEWHERE), digests: DigestCheck = SAME
) -> str:
    return reason(REPORT, OLD, new, DriftReport(rows, 0.01, detectable={"a (smoke)": 1.8}), digests)


def test_other_draws_without_drift_come_with_the_nearest_comparison_and_what_was_detectable() -> None:
    assert _why() == (
        "its trials are other draws (jax 0.11.2 -> 0.10.2, device H200 -> cpu); no drift shown; nearest: "
        "a on t (smoke): reward: median 1 -> 2, A12 = 0.60, p = 0.7 (Holm); found would have been "
        "with probability 0.95 a shift of all conditions by 1.8 SD in a (smoke). With 10 trials a side a verdict "
        "near its bound can fall either way by chance (p was 0.04, and is 0.06); `--claims-trials N` looks at more"
    )


@pytest.mark.parametrize("rows", [(), (replace(FINE, status="no reference", p=None, p_holm=None),), (ELSEWHERE,)])
def test_without_a_check_nothing_is_known_of_drift(rows: tuple[DriftRow, ...]) -> None:
    assert "whether they drifted is not known" in _why(rows=rows)


def test_drift_of_other_versions_and_of_the_method_elsewhere_is_said() -> None:
    upgraded = DriftReport((replace(FINE, status="drift"),), 0.01)
    found = reason(REPORT, OLD, NEW, DriftReport((FINE,), 0.01), SAME, upgraded)
    assert found == "the trials of a on t (smoke) have drifted from those of other versions (see above)"
    other = replace(FINE, label="a on another (smoke)", status="drift")
    assert "but trials of the same method have drifted: a on another (smoke)" in _why(rows=(FINE, other))


def test_a_drift_that_was_not_repeated_is_said() -> None:
    told = _why(rows=(replace(FINE, status="not repeated", p_holm=0.002), replace(FINE, metric="steps", p_holm=0.002)))
    assert "device H200 -> cpu); trials with fresh seeds have not shown their drift again (see above). With 10" in told
    assert "is not known" not in told


def test_a_change_of_what_is_computed_is_told_from_chance() -> None:
    assert _why(replace(NEW, trials="1")).startswith("from the same trials to the bit")
    drifted = replace(FINE, status="drift")
    assert _why(rows=(drifted,)) == "the trials of a on t (smoke) have drifted from the reference trials (see above)"
    changes = [DigestChange(condition * 64, 0, "x", "y") for condition in "cd"]
    assert "the code which runs them has changed, or its processor is another one" in _why(
        digests=DigestCheck(10, tuple(changes[:1]))
    )
    assert "other draws" in _why(digests=DigestCheck(10, tuple(changes[1:])))
