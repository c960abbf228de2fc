"""Verdicts as a table for the terminal."""

from __future__ import annotations

import functools
import io
import os
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Final, Literal

from rich.cells import cell_len, set_cell_size
from rich.text import Text

from evoclaims.core.printable import printable, spelled
from evoclaims.core.provenance import changing_flags
from evoclaims.judging.drift_report import DriftReport
from evoclaims.judging.verdict import Outcome
from evoclaims.report import table_cells
from evoclaims.report.console import PlainSpokenConsole
from evoclaims.verdicts import history, other_code
from evoclaims.verdicts.claim_report import ClaimReport, Tried

SENTENCE: Final = 16
"""Columns of the terminal that other columns leave to the sentence, if they can."""

PIPE: Final = 100
"""Columns of a file or another program."""

_CLAIMED: Final = "what is claimed"
_GAP: Final = "  "

_COLOURS = {
    Outcome.SUPPORTED: "green",
    Outcome.REFUTED: "red",
    Outcome.SMALLER: "magenta",
    Outcome.INCONCLUSIVE: "yellow",
    Outcome.ERROR: "bold red",
    Outcome.NOT_RUN: "dim",
}


def columns(width: int, is_terminal: bool) -> int:
    """Return how wide lines may be: as wide as the terminal, or COLUMNS; else, as in a log, `PIPE`."""
    return width if is_terminal or os.environ.get("COLUMNS") else PIPE


def verdict_table(reports: Sequence[ClaimReport], width: int, colour: bool, encoding: str | None = None) -> str:
    """Return a table, one line for each claim: id, sentence, verdict, n, effect, p beside the attainable p, evidence.

    The sentence is shortened to the terminal's width, never the id. Where that leaves it little room, columns are left
    out, the evidence first. Characters that the terminal's `encoding` lacks are spelled before the layout.
    """
    ordered = history.ordered(reports)
    column = functools.partial(_padded, encoding=encoding)
    names = column("claim", [printable(report.name) for report in ordered], most=width // 2)
    verdicts = column("verdict", [table_cells.verdict_of_versions(report) for report in ordered])
    columns = next(
        (found for found in _choices(ordered, column) if _room(width, names, verdicts, *found) >= SENTENCE), ()
    )
    room = max(_room(width, names, verdicts, *columns), len(_CLAIMED))
    sentences = column(_CLAIMED, [_shortened(f"{one.statement} ({one.where})", room, encoding) for one in ordered])
    heading, *rows = zip(names, sentences, verdicts, *columns, strict=True)
    lines = [Text(_GAP.join(heading), style="bold")]
    for report, (name, sentence, verdict, *rest) in zip(ordered, rows, strict=True):
        styled = (verdict, _COLOURS[report.outcome])
        lines.append(Text.assemble(name + _GAP + sentence + _GAP, styled, *(_GAP + cell for cell in rest)))
    folders = sorted({os.path.relpath(Path(report.evidence).parent) for report in reports if report.evidence})
    captions = [f"evidence: {printable(folder)}/<claim>.json" for folder in folders]
    if any(report.as_expected for report in reports):
        captions.append("* examined and accepted (expect= or @expected in the claim)")
    if any(report.tried is Tried.INSENSITIVE for report in reports):
        captions.append("insensitive: no fault planted in the claim's methods changes its verdict, so it is no support")
    if any(report.is_vacuous for report in reports):
        captions.append("vacuous: a null agent, which has learnt nothing, is supported as well, so it is no support")
    if any(report.depends_on_the_reading for report in reports):
        captions.append("by reading: another reading of the sentence gives another verdict (evoclaims audit)")
    captions += other_code.lines(reports)
    below = _rendered("\n".join(captions), width, colour).splitlines() if captions else []
    return "\n".join([*(_rendered(line, width, colour).rstrip() for line in lines), *map(str.rstrip, below)])


def _padded(
    heading: str, cells: Sequence[str], *, right: bool = False, most: int = 10_000, encoding: str | None = None
) -> list[str]:
    """Return a heading and the cells below it, padded to one width, at the left where they end at the `right`.

    A cell longer than `most` columns of a terminal pushes the rest of its line to the right.
    """
    texts = [spelled(text, encoding) for text in (heading, *cells)]
    wide = min(max(map(cell_len, texts)), max(most, len(heading)))
    padded = ((text, " " * (wide - cell_len(text))) for text in texts)
    return [spaces + text if right else text + spaces for text, spaces in padded]


def _choices(reports: Sequence[ClaimReport], column: Callable[..., list[str]]) -> Iterator[tuple[list[str], ...]]:
    """Yield the columns that may follow the verdict, all of them first, then fewer and shorter ones."""
    n = column("n", [table_cells.trials(report) for report in reports], right=True)
    effect = column("A12", [table_cells.effect(report) for report in reports], right=True)
    attainable = column("p (attainable)", [table_cells.p(report) for report in reports])
    p = column("p", [table_cells.p(report, attainable=False) for report in reports])
    evidence = column("evidence", [printable(Path(report.evidence).name) for report in reports])
    if any(report.evidence for report in reports):
        yield n, effect, attainable, evidence
    yield n, effect, attainable
    yield n, effect, p
    yield n, effect
    yield (n,)


def _room(width: int, *columns: list[str]) -> int:
    """Return how many columns of a terminal are left for the sentence."""
    return width - sum(cell_len(column[0]) + len(_GAP) for column in columns)


def _shortened(text: str, room: int, encoding: str | None) -> str:
    """Return a text on one line that is no wider than `room`."""
    plain, end = spelled(printable(" ".join(text.split())), encoding), spelled("…", encoding)
    return plain if cell_len(plain) <= room else set_cell_size(plain, room - len(end)).rstrip() + end


def explanations(reports: Sequence[ClaimReport], width: int, colour: bool) -> str:
    """Return a line for every verdict that is not plainly supported: why, what was accepted, what its trials did."""
    lines = []
    for report in reports:
        broken = report.verdict.without_result if report.verdict else ""
        over = report.verdict.overspent if report.verdict else ""
        plain = report.outcome == Outcome.SUPPORTED and report.expected in (None, report.outcome)
        if plain and not (broken or over or (report.verdict and report.verdict.copies)):
            continue
        note = ""
        if report.expected is not None and report.outcome != Outcome.NOT_RUN:
            kept = "accepted" if report.as_expected else f"no longer {report.expected}, which was accepted"
            note = f" [{kept}: {report.because}]"
        worst = (f" [worst rank: {broken}]" if broken else "") + (f" [over budget: {over}]" if over else "")
        lines.append(f"{report.outcome.symbol} {report.name}: {report.reason}{worst}{note}")
    return _rendered("\n".join(" ".join(line.split()) for line in lines), width, colour) if lines else ""


def drift_lines(drift: DriftReport, changed: Sequence[str], compared: int) -> str:
    """Return what the comparison with the committed reference trials found; `changed` has a label for each trial."""
    head = f"reference trials: {drift.counts}"
    undecided = [drift.undecided] if drift.nearest is not None and not drift.drifted else []
    where = ": " * bool(changed) + ", ".join(f"{label} ({count})" for label, count in Counter(changed).items())
    flags = changing_flags()
    because = (
        f"since XLA_FLAGS here change bits ({flags}), and none has a reference of the same flags, machine and versions"
        if flags
        else "since none has a reference of the same machine and versions"
    )
    bits = (
        f"to the bit: {compared} trials compared with the same machine and versions, {len(changed)} changed{where}"
        if compared
        else f"to the bit: no trial could be compared, {because}"
    )
    return "\n".join([head, *drift.lines, *undecided, bits])


def _rendered(content: Text | str, width: int, colour: bool) -> str:
    """Return rich content as text; a `Text` stays on one line, whatever the width."""
    file = io.StringIO()
    system: Literal["standard"] | None = "standard" if colour else None
    console = PlainSpokenConsole(file=file, width=max(width, 60), force_terminal=colour, color_system=system)
    console.print(content, soft_wrap=isinstance(content, Text))
    return file.getvalue().rstrip("\n")
