"""All verdicts in a small Markdown table: a line per sentence of the paper, and in each column only marks."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import Final

from evoclaims.judging.verdict import Outcome
from evoclaims.report.markdown_text import literal, table
from evoclaims.report.table_cells import NONE, in_the_papers_order
from evoclaims.verdicts.claim_report import ClaimReport, named
from evoclaims.verdicts.sensitivity import APART, Tally

WORDS: Final = 10
"""Words of a sentence that has no short form."""

HEADINGS: Final = ("claim", "the paper says")


def marks(
    columns: Mapping[str, Sequence[ClaimReport]], sentences: Mapping[str, str], short: Mapping[str, str] | None = None
) -> str:
    """Return the table of the paper's own claims; controls are left out.

    Args:
        columns: reports by heading.
        sentences: the paper's own by claim and case, such as "G1[n_parity]".
        short: the sentences to show, in a short form, by the first column; without any all, cut after `WORDS` words.
    """
    cases: dict[tuple[str, str], dict[str, list[ClaimReport]]] = {}
    for heading, reports in columns.items():
        for report in in_the_papers_order(reports):
            if not report.is_control:
                line = cases.setdefault((report.claim, sentences[report.name]), defaultdict(list))
                line[heading].append(report)
    several = {claim for claim, count in Counter(claim for claim, _ in cases).items() if count > 1}
    rows = []
    for (claim, sentence), found in cases.items():
        named_cases = dict.fromkeys(report.case for reports in found.values() for report in reports)
        name = literal(named(claim, ", ".join(named_cases) if claim in several else ""))
        if not short or name in short:
            text = short[name] if short else literal(_cut(sentence))
            rows.append((name, text, *(mark(found[heading]) for heading in columns)))
    return table((*HEADINGS, *map(literal, columns)), rows)


def mark(reports: Iterable[ClaimReport]) -> str:
    """Return the mark of a sentence's cases, such as "✓"; with numbers of cases where they differ, such as "✓1 ✗3".

    Support that is counted apart is in brackets.
    """
    tallies = Counter(report.counted_as for report in reports if report.outcome is not Outcome.NOT_RUN)
    found: Counter[str] = Counter()
    for tally in Tally:
        found[f"({tally.symbol})" if tally in APART else tally.symbol] += tallies[tally]
    shown = {symbol: count for symbol, count in found.items() if count}
    if len(shown) < 2:
        return next(iter(shown), NONE)
    return " ".join(f"{symbol}{count}" for symbol, count in shown.items())


def short_sentences(text: str) -> dict[str, str]:
    """Return the sentences of a table that was written before, by the first column."""
    _, _, *lines = [line for line in text.splitlines() if line.startswith("|")] or ["", ""]  # two are the heading
    rows = (line.strip("|\n ").split(" | ") for line in lines)
    return {cells[0]: cells[1] for cells in rows if len(cells) >= len(HEADINGS)}


def _cut(sentence: str) -> str:
    """Return the first words of a sentence."""
    words = sentence.split()
    return sentence if len(words) <= WORDS else " ".join(words[:WORDS]) + " …"
