"""The report as Markdown: the same verdicts for readers of a repository or of a terminal."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Final

from evoclaims.judging.verdict import Outcome
from evoclaims.report.formatting import clean, number, p_value, plural
from evoclaims.report.model import Board, Page, Section

_MARKS: Final = re.compile(r"([\\`*_\[\]#|~$@]|^[-+=]|:(?=[/\w]))")
"""What means something to Markdown, or to a forge that links names and addresses."""

_ENTITIES: Final = {"&": "&amp;", "<": "&lt;", ">": "&gt;"}
_ITEM: Final = re.compile(r"^(\d+)([.)])(?=\s|$)")


def markdown(page: Page) -> str:
    """Return the whole report."""
    blocks = [f"# {literal(page.title)}", literal(page.generated), *(f"> {literal(notice)}" for notice in page.notices)]
    if page.sections:
        blocks += ["## Verdicts", _scoreboard(page)]
    for board in page.boards:
        if board.sections:
            blocks += [f"## Claims at the {literal(board.tier)} tier", _overview(board)]
            blocks += [block for section in board.sections for block in _section(section, page)]
    if page.robustness:
        blocks += ["## Which conclusions hang on a detail?", _details(page), _robustness(page)]
    return "\n\n".join(block for block in blocks if block) + "\n"


def literal(text: str) -> str:
    """Return a text that Markdown shows as it is, on one line."""
    entities = "".join(_ENTITIES.get(character, character) for character in _MARKS.sub(r"\\\1", clean(text)))
    return _ITEM.sub(r"\1\\\2", entities).replace("www.", "www\\.")


def _table(header: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table of cells that are Markdown already."""
    head = list(header)
    lines = [head, ["---"] * len(head), *map(list, rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _scoreboard(page: Page) -> str:
    """Count verdicts by tier."""
    boards = [board for board in page.boards if board.sections]
    return _table(
        ("tier", *map(str, Outcome), "looked into and accepted"),
        ((literal(b.tier), *(str(b.count(outcome)) for outcome in Outcome), str(b.accepted)) for b in boards),
    )


def _details(page: Page) -> str:
    """List the variants."""
    return "\n".join(f"* {literal(name)}: {literal(says)}" for name, says in page.tried.items())


def _robustness(page: Page) -> str:
    """Return one line a claim, and a column a variant."""
    return _table(
        ("claim", "tier", "the protocol", *map(literal, page.tried)),
        (
            (
                literal(row.claim),
                literal(row.tier),
                literal(row.plain),
                *(
                    f"**{literal(row.outcomes[name])}**"
                    if name in row.hangs_on
                    else literal(row.outcomes.get(name, "–"))
                    for name in page.tried
                ),
            )
            for row in page.robustness
        ),
    )


def _verdict(section: Section) -> str:
    """Return a verdict with its symbol; an asterisk for one that was looked into and accepted."""
    return literal(f"{section.outcome.symbol} {section.outcome}" + ("*" if section.as_expected else ""))


def _overview(board: Board) -> str:
    """Return one line a claim."""
    return _table(
        ("claim", "place", "verdict", "n", "A12", "p (attainable)"),
        (
            (
                f"[{literal(s.name)}](#{s.anchor})",
                literal(s.where),
                _verdict(s),
                str(s.n) if s.n else "–",
                number(s.a12),
                "–" if s.p is None else literal(f"{p_value(s.p)} ({p_value(s.attainable_p)})"),
            )
            for s in board.sections
        ),
    )


def _section(section: Section, page: Page) -> Iterator[str]:
    """Yield the blocks of one claim."""
    yield f'<a id="{section.anchor}"></a>\n\n### {literal(section.name)} ({literal(section.tier)}): {_verdict(section)}'
    yield f"> {literal(section.paper or section.statement)}\n>\n> {literal(section.where)}"
    if section.paper:
        yield f"Judged at this tier: {literal(section.statement)}"
    for warning in (*section.warnings, section.change):
        yield f"**{literal(warning)}**" if warning else ""
    yield literal(section.reason)
    if section.because:
        yield f"Accepted as {literal(section.expected or '')}: {literal(section.because)}"
    parts = [part for part in section.parts if part.numbers]
    if parts:
        yield "\n".join(
            f"* {literal(part.describe)}: {literal('; '.join(f'{name} {value}' for name, value in part.numbers))}"
            + (f" ({literal(part.detail)})" if part.detail else "")
            for part in parts
        )
    if section.protocol:
        yield literal(section.protocol)
    for key in section.conditions:
        condition = page.conditions[key]
        yield f"{literal(condition.label)}: {literal(condition.says)}"
    if section.made:
        yield "Made by: " + "; ".join(
            literal(f"{plural(one.count, 'trial')} on {one.origin.device}, {one.origin.code}") for one in section.made
        )
    if section.history:
        yield _table(
            ("accepted", "verdict", "n", "p", "rules"),
            (
                tuple(
                    map(
                        literal, (e.date, e.outcome, str(e.n), p_value(e.p), e.fingerprint[:9] + " (new)" * e.new_rules)
                    )
                )
                for e in section.history
            ),
        )
    else:
        yield "No verdict of this claim has been accepted yet."
