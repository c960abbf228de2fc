"""What the page opens with: one line for each sentence of the paper, with its verdict on every reading."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field

from evoclaims.report.model import Page, Section
from evoclaims.verdicts.robustness import Robustness


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
