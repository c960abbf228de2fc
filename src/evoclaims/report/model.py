"""What a report shows, as data: no HTML, no Markdown; texts are raw; renderers clean and escape them."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from evoclaims.figures.replication import Replication
from evoclaims.judging.verdict import Outcome
from evoclaims.report import table_cells
from evoclaims.report.across import AcrossShown
from evoclaims.report.evidence import Part
from evoclaims.report.formatting import counted
from evoclaims.report.training_curves import CurvePanel, WatchShown
from evoclaims.report.trial_summary import Origin
from evoclaims.verdicts import history
from evoclaims.verdicts.claim_report import APART, ClaimReport, Tally
from evoclaims.verdicts.history import AcceptedVerdict, key_of
from evoclaims.verdicts.mutation_matrix import Attempt, Fate, Matrix, current, score
from evoclaims.verdicts.transitions import Robustness

FATES: Final = ", ".join(f"{fate.symbol} {fate}" for fate in Fate)
"""What the symbols in the grid of faults say."""


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


@dataclass(frozen=True)
class ConditionTrials:
    """The trials of one condition behind one or more claims.

    Attributes:
        label: such as "neat on n_parity".
        says: in words, how many trials with how many points each.
        settings: names and values of everything that was fixed.
        curves: panels over training.
    """

    label: str
    says: str
    settings: tuple[tuple[str, str], ...]
    curves: tuple[CurvePanel, ...]


@dataclass(frozen=True)
class Section:
    """One claim at one tier.

    Attributes:
        report: of the claim.
        anchor: its name in the page's address.
        methods: those that it names.
        places: the sections of the paper that it names.
        paper: the paper's own sentence, where another one was judged; else empty.
        design: how it was judged, in words.
        parts: its evidence.
        conditions: keys of `Page.conditions`.
        made: how many of its trials were made where.
        warnings: what a reader should know first.
        history: accepted verdicts, oldest first; a new tuple begins where what is judged has changed.
        change: what differs from the last accepted verdict; empty when nothing does.
        faults: which planted faults change the verdict.
        nulls: which null agents satisfy the assertion.
        read: whether the verdict depends on the reading.
        power: of a verdict that is inconclusive.
    """

    report: ClaimReport
    anchor: str
    methods: tuple[str, ...]
    places: tuple[str, ...]
    paper: str = ""
    design: str = ""
    parts: tuple[Part, ...] = ()
    conditions: tuple[str, ...] = ()
    made: Counter[Origin] = field(default_factory=Counter)
    warnings: tuple[str, ...] = ()
    history: tuple[tuple[AcceptedVerdict, ...], ...] = ()
    change: str = ""
    faults: str = ""
    nulls: str = ""
    read: str = ""
    power: str = ""

    @property
    def devices(self) -> str:
        """How many trials were made on which devices."""
        return counted(origin.device for origin in self.made.elements())


@dataclass(frozen=True)
class Board:
    """The claims of a tier, and how they are counted."""

    tier: str
    sections: tuple[Section, ...]

    @property
    def papers(self) -> tuple[Section, ...]:
        """The claims of the paper, without controls and mechanisms."""
        return tuple(section for section in self.sections if not section.report.is_control)

    @property
    def others(self) -> str:
        """How the other claims ended, such as "controls: 9 supported"; empty if there are none."""
        return table_cells.others([section.report for section in self.sections])

    @property
    def counts(self) -> Mapping[Tally, int]:
        """The number of the paper's claims by what they count as; of outcomes that no claim has, too."""
        found = table_cells.counts(section.report for section in self.papers)
        return {tally: found.get(tally, 0) for tally in Tally if tally in found or tally not in (*APART, Tally.SMALLER)}

    @property
    def accepted(self) -> int:
        """How many verdicts other than supported were examined and accepted."""
        reports = [section.report for section in self.sections]
        return sum(report.as_expected and report.outcome is not Outcome.SUPPORTED for report in reports)


@dataclass(frozen=True)
class PaperFigure:
    """A figure of the paper, redrawn: what it shows, and the bytes of an SVG."""

    title: str
    says: str
    picture: bytes


@dataclass(frozen=True)
class Page:
    """A whole report.

    Attributes:
        title: the paper's.
        name: the reproduction's.
        boards: one for each tier.
        conditions: by key.
        notices: what a reader should know about the whole.
        figures: of the paper.
        missing: sentences about missing figures.
        variants: of the protocol, by name: what differs.
        robustness: claims that were judged under a variant too.
        numbers: published ones beside ours.
        put_to_the_paper: what the claims' assertions make of the published numbers, in sentences.
        faults: which planted faults the claims notice, by tier.
        across: what `evoclaims across` has last found; None if it has not run.
        watch: the last series of nights at each tier.
        generated: when, and by which version; free text.
    """

    title: str
    name: str
    boards: tuple[Board, ...]
    conditions: Mapping[str, ConditionTrials] = field(default_factory=dict)
    notices: tuple[str, ...] = ()
    figures: tuple[PaperFigure, ...] = ()
    missing: tuple[str, ...] = ()
    variants: Mapping[str, str] = field(default_factory=dict)
    robustness: tuple[Robustness, ...] = ()
    numbers: tuple[Replication, ...] = ()
    put_to_the_paper: tuple[str, ...] = ()
    faults: tuple[FaultGrid, ...] = ()
    across: AcrossShown | None = None
    watch: tuple[WatchShown, ...] = ()
    generated: str = ""

    @property
    def tried(self) -> Mapping[str, str]:
        """Variants that some claim was judged under."""
        names = {name for row in self.robustness for name in row.outcomes}
        return {name: says for name, says in self.variants.items() if name in names}

    def protocols(self, section: Section) -> str:
        """Return how a claim ends under the variants of the protocol; empty where it was judged under none."""
        key = section.report.name, section.report.tier
        found: defaultdict[Tally, list[str]] = defaultdict(list)
        for row in self.robustness:
            for variant, outcome in row.outcomes.items() if (row.claim, row.tier) == key else ():
                found[outcome].append(variant)
        return "; ".join(f"{outcome} under {', '.join(variants)}" for outcome, variants in found.items())

    @property
    def sections(self) -> Sequence[Section]:
        """All claims in the order of the page."""
        return [section for board in self.boards for section in board.sections]
