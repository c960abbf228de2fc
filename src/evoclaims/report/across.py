"""Claims by environments: as tables, and kept in a store for the report."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import msgspec
from rich.table import Table

from evoclaims.core.errors import UserError
from evoclaims.core.files import read_file, write_atomically
from evoclaims.report.console import SpelledTable
from evoclaims.report.formatting import literal, p_value, plural, table
from evoclaims.report.table_cells import NONE
from evoclaims.verdicts.across import Across, Cell, Judged
from evoclaims.verdicts.export import Row
from evoclaims.verdicts.source_trials import SourceTrials, versions_of

COLUMN: Final = 22
"""Characters that an environment takes in the terminal, with the space before it."""


LEGEND: Final = (
    "Against the first environment: A12 is the chance that a trial is higher than there, and p the drift check's "
    "(of the method, Holm), with the measure that differs most; then how many trials differ in a bit."
)


def terminal(found: Across, width: int) -> list[Table]:
    """Return the table for a terminal of `width` columns, in parts where the environments do not fit side by side."""
    names = max((len(name) for name in found.claims), default=0) + 1
    labels = [one.label for one in found.environments]
    beside = max(1, (width - names) // COLUMN)
    return [_part(found, labels[start : start + beside]) for start in range(0, len(labels), beside)]


def _part(found: Across, labels: Sequence[str]) -> Table:
    shown = SpelledTable(pad_edge=False, box=None)
    shown.add_column("claim", no_wrap=True)
    for label in labels:
        shown.add_column(label, max_width=COLUMN - 1)
    for claim in found.claims:
        cells = (found.cells.get((claim, label)) for label in labels)
        shown.add_row(claim, *("\n".join(cell_lines(cell)) for cell in cells))
    return shown


def markdown(found: Across, command: str) -> str:
    """Return a page: what changed, the table, the lines that belong to it, and the command that makes it."""
    labels = [one.label for one in found.environments]
    rows = [
        [literal(claim), *("<br>".join(map(literal, cell_lines(found.cells.get((claim, label))))) for label in labels)]
        for claim in found.claims
    ]
    parts = [
        f"# {literal(headline(found))}",
        table(["claim", *map(literal, labels)], rows),
        LEGEND,
        "\n".join(f"* {literal(line)}" for line in found.lines),
        f"```sh\n{command}\n```",
    ]
    return "\n\n".join(filter(None, parts)) + "\n"


def headline(found: Across) -> str:
    """Return in a sentence what changed against the first environment, and what was not judged."""
    parts = [f"{label} changes {', '.join(claims)}" for label, claims in found.changed.items()]
    parts += [f"{label} has no verdicts" for label in found.without_verdicts]
    parts += [f"{label} has errors in {', '.join(claims)}" for label, claims in found.broken.items()]
    if not found.judged:
        return f"No claim was judged{': ' * bool(parts)}{'; '.join(parts)}."
    if parts:
        return f"{'; '.join(parts)}."
    compared = len(found.environments) - 1
    if not compared:
        return "There is one environment alone, so that nothing is compared."
    return f"No verdict changed and no drift was shown in {plural(compared, 'environment')} after the first."


def rows(found: Across) -> list[Row]:
    """Return one row per claim and environment."""
    judged: list[Row] = [
        {
            "environment": one.label,
            "claim": claim,
            "outcome": cell.outcome,
            "n": cell.n,
            "verdict_changed": cell.verdict_changed,
            "repeated": cell.repeated,
            "compared_to_the_bit": cell.compared,
            "bits_changed": cell.changed,
            "drifted": cell.drifted,
            **{
                f"drift_{name}": getattr(cell.drift, name, None)
                for name in ("metric", "a12", "p_holm", "median_ref", "median_new")
            },
            "versions": {name: list(those) for name, those in versions_of(_sources(one, claim)).items()},
            "trouble": "",
        }
        for one in found.environments
        for claim in found.claims
        if (cell := found.cells.get((claim, one.label))) is not None
    ]
    return judged + [{"environment": one.label, "trouble": one.trouble} for one in found.environments if one.trouble]


def _sources(one: Judged, claim: str) -> Sequence[SourceTrials]:
    return one.reports[claim].sources if claim in one.reports else ()


def cell_lines(cell: Cell | None) -> tuple[str, ...]:
    """Return the lines of a cell: the verdict, and how its trials compare with the first environment's."""
    if cell is None:
        return (NONE,)
    verdict = f"{cell.outcome.symbol} {cell.outcome}{', CHANGED' * cell.verdict_changed}"
    if cell.was is None:
        return (verdict,)
    if not cell.repeated:
        return verdict, "the same trials" if cell.n and cell.same else NONE
    if not cell.without_bits and not cell.changed and not cell.drifted:
        return verdict, "same to the bit"
    bits = f"{cell.changed} of {cell.compared} differ" if cell.compared else "other machine"
    if cell.drift is None:
        return verdict, bits
    drift = f"A12 {cell.drift.a12:.2f}, p {p_value(cell.drift.p_holm)}{', DRIFT' * cell.drifted}"
    return verdict, drift, bits


FILE: Final = "across.json"


@dataclass(frozen=True)
class AcrossShown:
    """What a report shows of claims in several environments.

    Attributes:
        made: when (ISO 8601).
        command: that made it.
        headline: what changed against the first environment, in a sentence.
        lines: what the table has no room for.
        labels: of the environments.
        rows: of each claim its name, and the lines of each environment's cell.
    """

    made: str
    command: str
    headline: str
    lines: tuple[str, ...]
    labels: tuple[str, ...]
    rows: tuple[tuple[str, tuple[tuple[str, ...], ...]], ...]


def keep(found: Across, store: Path, made: str, command: str) -> None:
    """Write what was found into the folder of a store, in place of what was found before."""
    labels = tuple(one.label for one in found.environments)
    rows = ((claim, tuple(cell_lines(found.cells.get((claim, label))) for label in labels)) for claim in found.claims)
    shown = AcrossShown(made, command, headline(found), tuple(found.lines), labels, tuple(rows))
    write_atomically(store / FILE, msgspec.json.encode(shown))


def last(stores: Iterable[Path]) -> AcrossShown | None:
    """Return what was found last, of all that is kept in the folders of some stores.

    Raises:
        UserError: when a file cannot be read or holds something else.
    """
    return max((one for store in stores if (one := _read(store / FILE))), key=lambda one: one.made, default=None)


def _read(path: Path) -> AcrossShown | None:
    """Return what is kept in a file; None without the file."""
    try:
        return msgspec.json.decode(read_file(path), type=AcrossShown)
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (OSError, ValueError, RecursionError) as error:
        raise UserError(f"{path} is not a file of `evoclaims across` ({error}). Delete it.") from error
