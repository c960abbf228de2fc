"""The report as Markdown: the same verdicts for readers of a repository or of a terminal."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from evoclaims.figures.replication import Replication
from evoclaims.report import replication_cells, table_cells
from evoclaims.report.fault_grid import LEGEND
from evoclaims.report.formatting import literal, plural, table
from evoclaims.report.model import Board, Page, Section
from evoclaims.report.table_cells import NONE
from evoclaims.verdicts.claim_report import Tally
from evoclaims.verdicts.robustness import Robustness


def markdown(page: Page) -> str:
    """Return the whole report."""
    blocks = [f"# {literal(page.title)}", literal(page.generated), *(f"> {literal(notice)}" for notice in page.notices)]
    if page.sections:
        blocks += ["## Verdicts", _scoreboard(page)]
    for board in page.boards:
        if board.sections:
            blocks += [f"## Claims at the {literal(board.tier)} tier", _overview(board)]
            blocks += [block for section in board.sections for block in _section(section, page)]
    if page.faults:
        blocks += ["## Which planted faults do the claims notice?", *_faults(page)]
    if page.robustness:
        blocks += ["## Which conclusions hang on a detail?", _details(page), robustness(page.robustness, page.tried)]
    if page.numbers:
        blocks += ["## Do the numbers replicate?", literal(replication_cells.HOW), numbers(page.numbers)]
        blocks += [literal(line) for line in (*replication_cells.totals(page.numbers), *page.put_to_the_paper)]
    return "\n\n".join(block for block in blocks if block) + "\n"


def _scoreboard(page: Page) -> str:
    boards = [board for board in page.boards if board.sections]
    tallies = [tally for tally in Tally if any(tally in board.counts for board in boards)]
    return table(
        ("tier", *map(str, tallies), "examined and accepted", "others"),
        (
            (literal(b.tier), *(str(b.counts.get(tally, 0)) for tally in tallies), str(b.accepted), b.others or NONE)
            for b in boards
        ),
    )


def _faults(page: Page) -> Iterator[str]:
    """Yield a grid for each tier: one line per claim, and a column per fault."""
    yield literal(f"{LEGEND}; one sign for each method or task of the claim that had the fault.")
    for grid in page.faults:
        yield literal(grid.score)
        if grid.rows:
            yield table(
                ("claim", "verdict", *map(literal, grid.mutants), "no fault noticed in"),
                (
                    (
                        literal(row.report.name),
                        literal(table_cells.verdict(row.report)),
                        *("".join(one.fate.symbol for one in row.cells.get(name, ())) for name in grid.mutants),
                        literal(row.unnoticed),
                    )
                    for row in grid.rows
                ),
            )
        if grid.untried:
            yield literal(f"Not tried: {', '.join(grid.untried)}.")


def _details(page: Page) -> str:
    return "\n".join(f"* {literal(name)}: {literal(says)}" for name, says in page.tried.items())


def robustness(rows: Sequence[Robustness], variants: Iterable[str]) -> str:
    """Return one line per claim and a column per variant; a verdict that differs from the protocol's is bold."""
    names = list(variants)
    return table(
        ("claim", "tier", "the protocol", *map(literal, names)),
        (
            (
                literal(row.claim),
                literal(row.tier),
                literal(row.plain),
                *(
                    f"**{literal(row.outcomes[name])}**"
                    if name in row.hangs_on
                    else literal(row.outcomes.get(name, NONE))
                    for name in names
                ),
            )
            for row in rows
        ),
    )


def numbers(found: Sequence[Replication]) -> str:
    """Return the published numbers beside ours, as a table."""
    return table(replication_cells.HEADINGS, (map(literal, replication_cells.cells(one)) for one in found))


def _overview(board: Board) -> str:
    """Return one line per claim."""
    cells = (table_cells.verdict, table_cells.trials, table_cells.effect, table_cells.p)
    return table(
        ("claim", "place", "verdict", "n", "A12", "p (attainable)"),
        (
            (
                f"[{literal(s.report.name)}](#{s.anchor})",
                literal(s.report.where),
                *(literal(cell(s.report)) for cell in cells),
            )
            for s in board.sections
        ),
        numbers=("n", "A12"),
    )


def _section(section: Section, page: Page) -> Iterator[str]:
    report = section.report
    heading = literal(f"{report.name} ({report.tier}): {table_cells.verdict(report)}")
    yield f'<a id="{section.anchor}"></a>\n\n### {heading}'
    yield f"> {literal(section.paper or report.statement)}\n>\n> {literal(report.where)}"
    if section.paper:
        yield f"Judged at this tier: {literal(report.statement)}"
    for warning in (*section.warnings, section.change):
        yield f"**{literal(warning)}**" if warning else ""
    yield literal(report.reason)
    yield literal(section.faults)
    yield literal(section.nulls)
    if len(report.readings) > 1:
        yield literal(f"Readings of the sentence: {section.read or 'not all are judged'}.")
    protocols = page.protocols(section)
    yield literal(f"Variants of the protocol: {protocols}." if protocols else "")
    yield literal(f"Power: {section.power}." if section.power else "")
    if report.because:
        yield f"Accepted as {literal(report.expected or '')}: {literal(report.because)}"
    parts = [part for part in section.parts if part.numbers]
    if parts:
        yield "\n".join(
            f"* {literal(part.describe)}: {literal('; '.join(f'{name} {value}' for name, value in part.numbers))}"
            + (f" ({literal(part.detail)})" if part.detail else "")
            + " **This part decided.**" * part.decided
            for part in parts
        )
    if section.design:
        yield literal(section.design)
    for key in section.conditions:
        condition = page.conditions[key]
        yield f"{literal(condition.label)}: {literal(condition.says)}"
    if section.made:
        yield "Made by: " + "; ".join(
            literal(f"{plural(count, 'trial')} on {origin.device}, {origin.code}")
            for origin, count in section.made.most_common()
        )
    if section.history:
        yield table(
            ("accepted", "verdict", "why", "rules"),
            (
                map(literal, (e.accepted, e.outcome, e.reason, e.fingerprint[:9] + " (new)" * (e is new)))
                for new, era in ((era[0] if index else None, era) for index, era in enumerate(section.history))
                for e in era
            ),
        )
    else:
        yield "No verdict of this claim has been accepted yet."
