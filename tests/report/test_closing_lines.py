"""The last lines of a run name what failed, what changed and the next command, in 100 columns."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hand_made_verdicts import report

from evoclaims.report.run_summary import closing_lines, without_smoke_test

GREEN = report("G1")
RED = report("G2", "refuted")
ACCEPTED = report("G3", "refuted", expected="refuted", because="known")


@pytest.mark.parametrize(
    ("reports", "changed", "drifted", "regressed", "lines"),
    [
        ([GREEN, ACCEPTED], [], [], [], ("nothing", "nothing", "evoclaims report ")),
        (
            [GREEN],
            None,
            [],
            [],
            ("nothing", "nothing to compare with: no verdict has been accepted", "evoclaims accept "),
        ),
        (
            [GREEN, RED],
            ["G1 (smoke)"],
            [],
            [],
            ("G2 (refuted)", "G1 (smoke)", "evoclaims status --tier smoke --only G2 "),
        ),
        ([GREEN], ["G1 (smoke)"], [], ["G1 (smoke)"], ("G1 (smoke), regression", "G1 (smoke)", "evoclaims compare ")),
        ([GREEN], [], ["a on b"], [], ("trials of a on b (drift)", "trials of a on b (drift)", "evoclaims compare ")),
        ([GREEN], None, ["a on b"], [], ("trials of a on b (drift)", "trials of a on b (drift)", "evoclaims compare ")),
    ],
)
def test_each_line_names_what_there_is(
    reports: list[object],
    changed: list[str] | None,
    drifted: list[str],
    regressed: list[str],
    lines: tuple[str, str, str],
) -> None:
    shown = closing_lines(reports, changed, drifted, regressed)  # type: ignore[arg-type]
    assert [line.partition(": ")[0] for line in shown] == ["failed", "changed", "next"]
    assert [line.partition(": ")[2] for line in shown[:2]] == list(lines[:2])
    assert shown[2].partition(": ")[2].startswith(lines[2])


def test_a_run_that_an_error_fails_has_not_failed_at_nothing() -> None:
    one, two = closing_lines([GREEN], [], [], errors=1), closing_lines([RED], [], [], errors=2)
    assert one == ["failed: what the error above says", "changed: nothing", "next: what the error above says"]
    assert two[0] == "failed: what 2 errors above say, G2 (refuted)"


def test_many_failures_stay_on_a_line() -> None:
    many = [replace(RED, claim=f"G{number}", case="neat-hyperneat") for number in range(20)]
    shown = closing_lines(many, [one.name for one in many], [])
    assert max(map(len, shown)) <= 100
    assert "G1[neat-hyperneat] (refuted) and 18 more" in shown[0]


def test_claims_without_a_smoke_test_are_counted_once() -> None:
    untested = [replace(GREEN, claim=claim, case=case, has_test=False) for claim, case in (("A", "x"), ("A", "y"))]
    assert without_smoke_test([GREEN]) == ""
    assert without_smoke_test([GREEN, *untested]) == "1 claim has no smoke test: evoclaims status --why"
    both = [*untested, replace(GREEN, claim="B", has_test=False)]
    assert without_smoke_test(both) == "2 claims have no smoke test: evoclaims status --why"
