"""The grid of claims and planted faults: which fault changes which verdict, as data for tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from evoclaims.verdicts import history
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.history import key_of
from evoclaims.verdicts.mutation_matrix import Attempt, Fate, Matrix, current, score

LEGEND: Final = ", ".join(f"{fate.symbol} {fate}" for fate in Fate)
"""What the symbols of a cell say."""


@dataclass(frozen=True)
class GridRow:
    """One claim.

    Attributes:
        report: of it.
        cells: by mutant, how it was tried in each method or task that the claim is about.
        unnoticed: methods that it names, and none of whose own faults changes its verdict.
    """

    report: ClaimReport
    cells: Mapping[str, Sequence[Attempt]]
    unnoticed: str


@dataclass(frozen=True)
class FaultGrid:
    """The claims of one tier on which faults were tried.

    Attributes:
        tier: its name.
        score: the mutation score, in a sentence.
        mutants: the faults that were tried.
        rows: the claims.
        untried: names of further judged claims, without a row in the matrix; may be empty.
    """

    tier: str
    score: str
    mutants: tuple[str, ...]
    rows: tuple[GridRow, ...]
    untried: tuple[str, ...]


def fault_grid(matrix: Matrix, tier: str, reports: Iterable[ClaimReport]) -> FaultGrid:
    """Return the grid of a tier; rows of the matrix about other than the current verdicts are left out."""
    ordered = history.ordered(reports)
    found = {report.name: (report, row) for report in ordered if (row := current(matrix, report)) is not None}
    rows = tuple(
        GridRow(report, _cells(row.attempts), "" if row.untried else ", ".join(row.unnoticed))
        for report, row in found.values()
    )
    return FaultGrid(
        tier=tier,
        score=score({key_of(report): row for report, row in found.values()}, tier),
        mutants=tuple(dict.fromkeys(mutant for row in rows for mutant in row.cells)),
        rows=rows,
        untried=tuple(report.name for report in ordered if rows and report.n and report.name not in found),
    )


def _cells(attempts: Sequence[Attempt]) -> dict[str, list[Attempt]]:
    by_mutant: dict[str, list[Attempt]] = {}
    for attempt in attempts:
        by_mutant.setdefault(attempt.mutant, []).append(attempt)
    return by_mutant
