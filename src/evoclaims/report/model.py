"""What a report shows, as plain data: no HTML, no Markdown, texts cleaned but not yet escaped."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from evoclaims.judging.verdict import Outcome
from evoclaims.report.evidence import Part
from evoclaims.report.formatting import counted, place_key
from evoclaims.report.origin import Made
from evoclaims.report.training_curves import CurvePanel
from evoclaims.verdicts.robustness import Robustness


@dataclass(frozen=True)
class Look:
    """One look at the data, and the smallest p that it can give for and against the claim."""

    n: int
    alpha: float
    supported: float
    refuted: float


@dataclass(frozen=True)
class Accepted:
    """A verdict of the past.

    Attributes:
        date: when it was accepted.
        outcome, n, p, reason: as they were.
        fingerprint: of what was fixed beforehand.
        new_rules: whether the fingerprint differs from the verdict's before: a new history begins.
        made: where its trials were made, in words.
        versions: of the packages that they were made with.
    """

    date: str
    outcome: str
    n: int
    p: float | None
    reason: str
    fingerprint: str
    new_rules: bool
    made: str
    versions: str


@dataclass(frozen=True)
class Champion:
    """The best individual of a condition's typical trial.

    Attributes:
        says: which trial, or why there is no picture.
        picture: an SVG's bytes; empty without one.
    """

    says: str
    picture: bytes = b""


@dataclass(frozen=True)
class Conditions:
    """The trials of one condition behind one or more claims.

    Attributes:
        label: such as "neat on n_parity".
        says: in words, how many trials with how many points each.
        settings: names and values of everything that was fixed.
        curves: panels over training.
        champion: its best individual.
    """

    label: str
    says: str
    settings: tuple[tuple[str, str], ...]
    curves: tuple[CurvePanel, ...]
    champion: Champion


@dataclass(frozen=True)
class Section:
    """One claim at one tier.

    Attributes:
        anchor: its name in the page's address.
        name, tier, methods: as claimed.
        statement: what was judged.
        paper: the paper's own sentence, where another one was judged; else empty.
        where, places: the place in the paper, and its sections.
        outcome, reason, expected, because: as in `ClaimReport`.
        describe, fingerprint, n, alpha, p, attainable_p, p_refuted, a12: of the verdict.
        looks, protocol: how it was judged.
        parts: its evidence.
        conditions: keys of `Page.conditions`.
        made: where its trials were made.
        warnings: what a reader should know first.
        history: accepted verdicts, oldest first.
        change: what differs from the last accepted verdict; empty when nothing does.
    """

    anchor: str
    name: str
    tier: str
    methods: tuple[str, ...]
    statement: str
    paper: str
    where: str
    places: tuple[str, ...]
    outcome: Outcome
    reason: str
    expected: str | None
    because: str
    describe: str = ""
    fingerprint: str = ""
    n: int = 0
    alpha: float | None = None
    p: float | None = None
    attainable_p: float | None = None
    p_refuted: float | None = None
    a12: float | None = None
    looks: tuple[Look, ...] = ()
    protocol: str = ""
    parts: tuple[Part, ...] = ()
    conditions: tuple[str, ...] = ()
    made: tuple[Made, ...] = ()
    warnings: tuple[str, ...] = ()
    history: tuple[Accepted, ...] = ()
    change: str = ""

    @property
    def as_expected(self) -> bool:
        """Whether the outcome was looked into and accepted."""
        return self.expected == self.outcome

    @property
    def devices(self) -> str:
        """How many trials were made on which devices."""
        return counted(one.origin.device for one in self.made for _ in range(one.count))


@dataclass(frozen=True)
class Board:
    """The scoreboard of a tier.

    Attributes:
        tier: its name.
        sections: its claims.
    """

    tier: str
    sections: tuple[Section, ...]

    def count(self, outcome: Outcome) -> int:
        """Return how many claims ended so."""
        return sum(section.outcome is outcome for section in self.sections)

    @property
    def accepted(self) -> int:
        """How many verdicts other than supported were looked into and accepted."""
        return sum(s.as_expected and s.outcome is not Outcome.SUPPORTED for s in self.sections)

    @property
    def by_place(self) -> Mapping[str, tuple[Section, ...]]:
        """Claims by the first section of the paper that they name."""
        names = sorted({section.places[0] for section in self.sections}, key=place_key)
        return {name: tuple(s for s in self.sections if s.places[0] == name) for name in names}


@dataclass(frozen=True)
class Plate:
    """A figure of the paper, redrawn.

    Attributes:
        title, says: what it shows.
        picture: an SVG's bytes.
    """

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
        plates: figures of the paper.
        missing: sentences about figures that are not among them.
        variants: of the protocol, by name: what differs.
        robustness: claims that were judged under a variant too.
        generated: when, and by which version; free text.
    """

    title: str
    name: str
    boards: tuple[Board, ...]
    conditions: Mapping[str, Conditions] = field(default_factory=dict)
    notices: tuple[str, ...] = ()
    plates: tuple[Plate, ...] = ()
    missing: tuple[str, ...] = ()
    variants: Mapping[str, str] = field(default_factory=dict)
    robustness: tuple[Robustness, ...] = ()
    generated: str = ""

    @property
    def tried(self) -> Mapping[str, str]:
        """Variants that some claim was judged under."""
        names = {name for row in self.robustness for name in row.outcomes}
        return {name: says for name, says in self.variants.items() if name in names}

    @property
    def sections(self) -> Sequence[Section]:
        """All claims in the order of the page."""
        return [section for board in self.boards for section in board.sections]
