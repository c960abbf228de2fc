"""What the page opens with: one line for each sentence of the paper, with its verdict on every reading."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field

from evoclaims.judging.verdict import Outcome
from evoclaims.report.model import Page, Section


@dataclass(frozen=True)
class UnderVariant:
    """What came of one case of a claim under a variant of the protocol.

    Attributes:
        says: the claim's name, the tier and the outcome.
        outcome: under the variant.
        differs: whether the protocol itself has another outcome.
    """

    says: str
    outcome: Outcome
    differs: bool


@dataclass(frozen=True)
class OpeningLine:
    """One sentence, which may be judged in several cases.

    Attributes:
        claim: its id.
        sentence: the paper's own.
        place: the section of the paper; empty where the line above has the same.
        cases: in the order of the tiers.
        variants: what came of its cases under each variant that was tried on one of them.
    """

    claim: str
    sentence: str
    place: str
    cases: tuple[Section, ...]
    variants: Mapping[str, tuple[UnderVariant, ...]] = field(default_factory=dict)

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


def _under_variants(page: Page, cases: list[Section]) -> dict[str, tuple[UnderVariant, ...]]:
    """Return what came of the cases of one sentence under each variant."""
    names = {(section.report.name, section.report.tier) for section in cases}
    rows = [row for row in page.robustness if (row.claim, row.tier) in names]
    return {
        variant: tuple(
            UnderVariant(f"{row.claim} ({row.tier}): {outcome}", outcome, variant in row.hangs_on)
            for row in rows
            if (outcome := row.outcomes.get(variant)) is not None
        )
        for variant in page.tried
    }
