"""What the page opens with: one line for each sentence of the paper, with its verdict on every reading."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from evoclaims.judging.verdict import Outcome
from evoclaims.report.formatting import plural
from evoclaims.report.model import Page, Section
from evoclaims.verdicts.robustness import Robustness
from evoclaims.verdicts.sentences import sentences


@dataclass(frozen=True)
class OpeningLine:
    """One sentence, which may be judged in several cases.

    Attributes:
        claim: its id.
        sentence: the paper's own.
        place: the section of the paper; empty where the line above has the same.
        cases: in the order of the tiers.
        variants: its cases that were judged under each variant that was tried on some claim.
    """

    claim: str
    sentence: str
    place: str
    cases: tuple[Section, ...]
    variants: Mapping[str, tuple[Robustness, ...]] = field(default_factory=dict)

    def at(self, tier: str) -> tuple[Section, ...]:
        """Return its cases at a tier."""
        return tuple(section for section in self.cases if section.report.tier == tier)


def opening_lines(page: Page) -> list[OpeningLine]:
    """Return the lines in the order of the page's claims."""
    together: defaultdict[tuple[str, str], list[Section]] = defaultdict(list)
    for section in page.sections:
        together[section.report.claim, section.paper or section.report.statement].append(section)
    lines: list[OpeningLine] = []
    place = ""
    for (claim, sentence), cases in together.items():
        shown, place = "" if cases[0].places[0] == place else cases[0].places[0], cases[0].places[0]
        lines.append(OpeningLine(claim, sentence, shown, tuple(cases), _under_variants(page, cases)))
    return lines


def _under_variants(page: Page, cases: list[Section]) -> dict[str, tuple[Robustness, ...]]:
    """Return the cases of one sentence that were judged under each variant."""
    names = {(section.report.name, section.report.tier) for section in cases}
    rows = [row for row in page.robustness if (row.claim, row.tier) in names]
    return {variant: tuple(row for row in rows if variant in row.outcomes) for variant in page.tried}


@dataclass(frozen=True)
class Finding:
    """Sentences of the paper that ended alike at a tier.

    Attributes:
        tier: where.
        kind: the name of their outcome in styles; empty where their cases ended differently.
        symbol: their outcome's; empty likewise.
        says: how many there are, in words.
        lines: the sentences.
    """

    tier: str
    kind: str
    symbol: str
    says: str
    lines: tuple[OpeningLine, ...]


def findings(page: Page, lines: Sequence[OpeningLine]) -> list[Finding]:
    """Return what came out, by sentence of the paper, at the first tier that has a verdict on one.

    A claim is counted once, and one that the result of another decides is not: as in `sentences`.
    """
    first = {line.claim: line for line in reversed(lines)}
    for board in page.boards:
        ended = [
            (first[one.claim], {case.outcome for case in one.cases} - {Outcome.NOT_RUN})
            for one in sentences(section.report for section in board.sections)
            if not one.same_as
        ]
        judged = [(line, outcomes) for line, outcomes in ended if outcomes]
        if judged:
            return list(_findings(board.tier, judged))
    return []


def _findings(tier: str, judged: Sequence[tuple[OpeningLine, set[Outcome]]]) -> Iterator[Finding]:
    """Yield the sentences whose cases all have one outcome, by outcome, and then the others."""
    of = f"of {plural(len(judged), 'sentence')} ({tier})"
    for outcome in Outcome:
        if alike := tuple(line for line, outcomes in judged if outcomes == {outcome}):
            says = f"{len(alike)} {of}: {outcome} in every case"
            yield Finding(tier, outcome.name.lower(), outcome.symbol, says, alike)
    if others := tuple(line for line, outcomes in judged if len(outcomes) > 1):
        yield Finding(tier, "", "", f"{len(others)} {of}: cases end differently", others)
