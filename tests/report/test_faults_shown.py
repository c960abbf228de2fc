"""Which planted faults claims notice, wherever verdicts are shown: never more than the matrix says."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hand_made_verdicts import report, verdict
from laboratory import Laboratory, better_solves, better_wins
from unpacked import whole

from evoclaims.judging.verdict import Outcome
from evoclaims.report import table_cells
from evoclaims.report.model import Board, Page, Section, fault_grid
from evoclaims.report.run_summary import run_summary
from evoclaims.report.terminal_table import verdict_table
from evoclaims.verdicts.claim_report import CONTROL, MECHANISM, ClaimReport, Tally, Tried
from evoclaims.verdicts.history import key_of
from evoclaims.verdicts.mutation_matrix import Attempt, Fate, Matrix, Sensitivity, tried

SENSITIVE, INSENSITIVE = Tried.SENSITIVE, Tried.INSENSITIVE
REPORTS = [
    report("G1", tried=SENSITIVE),
    report("G2", tried=INSENSITIVE),
    report("G3", "refuted", tried=INSENSITIVE),
    report("G4"),
]


def test_support_that_no_fault_could_change_is_counted_apart() -> None:
    assert [one.counted_as for one in REPORTS] == [Tally.SUPPORTED, Tally.INSENSITIVE, Tally.REFUTED, Tally.SUPPORTED]
    assert table_cells.totals(REPORTS) == "2 supported, 1 supported but insensitive, 1 refuted"
    assert table_cells.faults(REPORTS) == "claims against planted faults: 1 sensitive, 2 insensitive, 1 not tried"
    text = run_summary(REPORTS)  # for continuous integration
    assert "**2 supported, 1 supported but insensitive, 1 refuted**" in text
    assert "✗ refuted, insensitive" in text
    assert "* claims against planted faults: 1 sensitive, 2 insensitive, 1 not tried" in text


@pytest.mark.parametrize("width", [60, 160])
def test_the_table_says_insensitive_beside_the_verdict(width: int) -> None:
    lines = verdict_table(REPORTS, width, False).splitlines()
    for name, said in (("G2", "✓ supported, insensitive"), ("G3", "✗ refuted, insensitive")):
        assert [said in line for line in lines if line.startswith(name)] == [True]
    assert sum("insensitive" in line for line in lines) == 3
    assert "insensitive: no fault planted" in " ".join(verdict_table(REPORTS, width, False).split())
    assert "insensitive" not in verdict_table([REPORTS[0], REPORTS[3]], width, False)


def row(of: ClaimReport, *fates: Fate, untried: tuple[str, ...] = ()) -> Sensitivity:
    attempts = (Attempt(f"fault {i}<b>", "method", f"m{i}", Outcome.REFUTED, fate) for i, fate in enumerate(fates))
    return Sensitivity(of.outcome, of.fingerprint, ("m0", "m1"), tuple(attempts), untried)


def test_the_grid_has_the_claims_that_the_matrix_is_about_and_names_the_others() -> None:
    new, stale, lone = report("G10"), report("G9", verdict=verdict(fingerprint="e" * 64)), report("G1")
    both = replace(row(new, Fate.SURVIVED), attempts=(*row(new, Fate.SURVIVED).attempts,) * 2)
    matrix: Matrix = {key_of(new): both, key_of(stale): row(report("G9"), Fate.KILLED), key_of(lone): row(lone)}
    grid = fault_grid(matrix, "smoke", [new, stale, lone])
    assert [one.report.name for one in grid.rows] == ["G1", "G10"]
    assert [f"{one.target}: {one.fate}" for one in grid.rows[1].cells["fault 0<b>"]] == ["m0: survived"] * 2
    assert (grid.rows[1].unnoticed, grid.untried) == ("m0, m1", ("G9",))
    assert fault_grid({}, "smoke", [new]).untried == ()
    assert fault_grid({}, "smoke", [new]).score == "Mutation score (smoke): not tried."


def page(filled: Laboratory) -> Page:
    sensitive, not_sensitive = filled.judge(better_wins), filled.judge(better_solves, id="T2")
    assert not_sensitive.outcome is not Outcome.NOT_RUN
    matrix = {
        key_of(sensitive): row(sensitive, Fate.KILLED, Fate.DRIFTED),
        key_of(not_sensitive): row(not_sensitive, Fate.SURVIVED, Fate.EQUIVALENT),
    }
    judged = [replace(one, tried=tried(matrix, one)) for one in (sensitive, not_sensitive)]
    return filled.page(*judged, mutants=matrix)


def test_the_report_shows_the_grid_and_the_score(filled: Laboratory) -> None:
    text = whole(page(filled))
    assert "Which planted faults do the claims notice?" in text
    assert "1 of 2 planted faults change a verdict, 1 more are found by the drift check" in text
    assert '<td title="m0: killed by the verdict">●</td>' in text
    assert '<td title="m1: equivalent">=</td>' in text
    assert "<span>fault 0&lt;b&gt;</span>" in text
    assert '<span class="tag">insensitive</span>' in text
    assert "Insensitive. Planted faults: 0 of 1 change this verdict, none of those in m0 or m1." in text


def test_a_scoreboard_counts_insensitive_support_controls_and_mechanisms_apart() -> None:
    others = [replace(REPORTS[0], claim=name, where=where) for name, where in (("C1", CONTROL), ("K1", MECHANISM))]
    sections = tuple(Section(one, one.name, (), (one.where,)) for one in (*REPORTS, *others))
    board = Board("smoke", sections)
    assert board.counts == {
        Tally.SUPPORTED: 2,
        Tally.INSENSITIVE: 1,
        Tally.REFUTED: 1,
        Tally.INCONCLUSIVE: 0,
        Tally.ERROR: 0,
        Tally.NOT_RUN: 0,
    }
    assert {Tally.INSENSITIVE, Tally.SMALLER}.isdisjoint(Board("smoke", sections[:1]).counts)
    counted = "controls: 1 supported; mechanisms: 1 supported"
    assert (len(board.papers), board.others, Board("smoke", sections[:1]).others) == (4, counted, "")
    text = whole(Page(title="A Paper", name="paper", boards=(board,)))
    assert '<li class="is-insensitive"><b>1</b> <span class="symbol" aria-hidden="true">✓</span>' in text
    assert f"<small>4 claims; {counted}</small>" in text
    assert 'viewBox="0 0 4 1"' in text


def test_without_a_matrix_no_claim_is_called_sensitive(filled: Laboratory) -> None:
    found = filled.page(filled.judge(better_wins))
    assert "Planted faults: not tried." in whole(found)
    assert "Mutation score" in whole(found)
    assert "sensitive" not in whole(found).replace("insensitive", "")
