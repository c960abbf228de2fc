"""What a claim asserts about trials: the interface of all kinds, and compounds with "and" and "or"."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import chain
from typing import Any, ClassVar, NoReturn

from evoclaims.core.errors import UserError
from evoclaims.judging.design import Design, Look
from evoclaims.judging.effect import a12, a12_interval, cliffs_delta
from evoclaims.judging.exact import smallest
from evoclaims.judging.reading import TrialReading
from evoclaims.judging.sample import Sample, Source, Trials
from evoclaims.judging.verdict import Bound, Direction, Evidence, Interval, PValues


@dataclass(frozen=True)
class Entry:
    """A kind's entry in the vocabulary; each text is one or more sentences.

    Attributes:
        syntax: how it is written in a claim, where `a` and `b` are trials of a method on a task.
        null: what is rejected for the claim to be supported, or why nothing is.
        supported: when the claim is.
        refuted: when the claim is, or is smaller than claimed.
        source: where the test is published.
    """

    syntax: tuple[str, ...]
    null: str
    supported: str
    refuted: str
    source: str


@dataclass(frozen=True)
class Finding:
    """What an assertion finds in trials.

    Attributes:
        p: for and against the assertion.
        attainable: the smallest of each that n and the ties allow.
        describe: makes the evidence, which takes many times as long as the tests.
        deciding: returns, for a direction, the index in `evidence` of the part that gives the p value.
    """

    p: PValues
    attainable: PValues
    describe: Callable[[], tuple[Evidence, ...]]
    deciding: Callable[[Direction], int]

    @cached_property
    def evidence(self) -> tuple[Evidence, ...]:
        """One entry for each part, made when it is asked for."""
        return self.describe()


@dataclass(frozen=True)
class Assertion(ABC):
    """One checkable sentence about trials.

    Each kind is a frozen dataclass that implements the abstract methods. Its fields are readings of trials, tuples of
    them, and numbers and words that are fixed beforehand; the claim's fingerprint includes all of them.

    Attributes:
        kind: a name for tables.
        entry: its entry in the vocabulary; a custom kind may have none.
    """

    kind: ClassVar[str]
    entry: ClassVar[Entry | None] = None

    @abstractmethod
    def describe(self) -> str:
        """Return the assertion in plain English."""

    def sources(self) -> tuple[Source, ...]:
        """Return the conditions it needs, without duplicates."""
        return tuple({reading.source.fingerprint: reading.source for reading in self.readings()}.values())

    def drawn(self) -> tuple[Source, ...]:
        """Return the conditions whose trials it takes for independent draws: all, unless it is no test."""
        return self.sources()

    def readings(self) -> tuple[TrialReading, ...]:
        """Return what it reads from trials."""
        values = [getattr(self, field.name) for field in fields(self)]
        each = chain.from_iterable(value if isinstance(value, tuple) else (value,) for value in values)
        return tuple(value for value in each if isinstance(value, TrialReading))

    def plain(self) -> dict[str, Any]:
        """Return the canonical description that the claim's fingerprint hashes, with the conditions' ids."""
        return {"kind": self.kind, **{field.name: _plain(getattr(self, field.name)) for field in fields(self)}}

    @abstractmethod
    def attainable(self, n: int, design: Design) -> PValues:
        """Return the smallest p, for and against, that `n` trials per side can give, without looking at values."""

    @abstractmethod
    def find(self, trials: Trials, design: Design, alpha: float) -> Finding:
        """Judge the trials at `alpha`.

        Raises:
            UnreadableTrialError: when a finished trial has no number that can be judged.
        """

    def looks(self, design: Design) -> tuple[Look, ...]:
        """Return this kind's looks: all of the design's, unless it needs every trial at once."""
        return design.looks

    def bounds(self, trials: Trials, n: int, design: Design) -> tuple[PValues, PValues]:
        """Bound p over all completions of `trials` to `n` per side: the lowest and the highest, for and against.

        The default bounds hold for every kind. The rank tests use them: with ties, no single completion is extreme (a
        tie among new values can give a lower p than distinct ones), so nothing tighter is safe for them.
        """
        return self.attainable(n, design), PValues(1.0, 1.0)

    def highest(self, trials: Trials, n: int, design: Design) -> PValues:
        """Bound p over all results that missing trials could have had: the highest, for and against.

        Args:
            trials: those with a result, at most `n` a condition.
            n: trials a side.
            design: as in `find`.
        """
        return self.bounds(trials, n, design)[1]

    def found(
        self,
        p: PValues,
        attainable: PValues,
        alpha: float,
        samples: tuple[Sample, ...],
        *,
        detail: str = "",
        bounds: tuple[Bound, ...] = (),
        intervals: Callable[[], tuple[Interval, ...]] = tuple,
        events: bool = False,
        effect: bool = False,
        tested: bool = True,
    ) -> Finding:
        """Return what this assertion has found, with one entry of evidence, whose fields the arguments are.

        `effect` says whether to report the effect size between the two samples, and `tested` whether p comes from a
        test: the p of a fact (0 for true, 1 for false) is not reported.
        """
        first, last = samples[0].values, samples[-1].values

        def evidence() -> tuple[Evidence, ...]:
            of_effect = (Interval("A12, 95% percentile bootstrap", *a12_interval(first, last)),) if effect else None
            entry = Evidence(
                kind=self.kind,
                describe=self.describe(),
                outcome=p.outcome(alpha),
                samples=samples,
                n=len(first),
                alpha=alpha,
                p=p.supported if tested else None,
                attainable_p=attainable.supported if tested else None,
                p_refuted=p.refuted if tested else None,
                attainable_p_refuted=attainable.refuted if tested else None,
                p_smaller=p.smaller,
                attainable_p_smaller=attainable.smaller,
                a12=a12(first, last) if effect else None,
                cliffs_delta=cliffs_delta(first, last) if effect else None,
                intervals=of_effect or intervals(),
                detail=detail,
                bounds=bounds,
                events=events,
            )
            return (entry,)

        return Finding(p, attainable, evidence, lambda direction: 0)

    def fact(self, holds: bool, alpha: float, sample: Sample, detail: str, *, events: bool = False) -> Finding:
        """Return the finding of an assertion that is true or false without a test."""
        p = PValues(0.0, 1.0) if holds else PValues(1.0, 0.0)
        return self.found(p, PValues(0.0, 0.0), alpha, (sample,), detail=detail, events=events, tested=False)

    def __and__(self, other: Assertion) -> AllOf:
        """Assert both."""
        return AllOf((*_parts(self, AllOf), *_parts(other, AllOf)))

    def __or__(self, other: Assertion) -> AnyOf:
        """Assert at least one, with Holm's correction."""
        return AnyOf((*_parts(self, AnyOf), *_parts(other, AnyOf)))

    def __bool__(self) -> NoReturn:
        """Reject use as a bool: only the judge decides.

        Raises:
            TypeError: always.
        """
        raise TypeError(
            "An assertion is neither true nor false until it is judged. Write verdict(a > b) instead of assert a > b; "
            "(a > b) & (c > d) or (a > b) | (c > d), with parentheses, instead of the words and, or; a < b instead of "
            "not a > b; a.between(low, high) instead of low < a < high."
        )


def _parts(value: object, joined_by: type[Compound]) -> tuple[Assertion, ...]:
    """Return the parts that `value` adds to a compound; flattened, since nested corrections would multiply."""
    if not isinstance(value, Assertion):
        raise UserError(f"Only assertions are joined with & and |, not {value!r}: put each in parentheses.")
    return value.parts if isinstance(value, joined_by) else (value,)


def _plain(value: object) -> object:
    """Return a kind's field as the fingerprint hashes it: 1 and 1.0 are equal."""
    if isinstance(value, TrialReading):
        return value.plain()
    if isinstance(value, tuple):
        return [_plain(one) for one in value]
    return float(value) if isinstance(value, int) else value


@dataclass(frozen=True)
class Compound(Assertion):
    """Several assertions that are judged as one; a subclass defines how their p values combine.

    Attributes:
        joint: the word between the parts.
        weakest: the direction in which the part with the largest p decides; in the other, the smallest decides.
    """

    parts: tuple[Assertion, ...]
    joint: ClassVar[str]
    weakest: ClassVar[Direction]

    def combine(self, parts: Sequence[PValues], *, corrected: bool = True) -> PValues:
        """Combine the parts' p; the result never falls when a part's p rises.

        The largest p is that of all parts together: an intersection-union test, which needs no correction. The smallest
        is that of some part, with Holm's correction: each more part is one more chance to err.
        """
        some = smallest if corrected else min
        every = max
        support, refute = (every, some) if self.weakest is Direction.FOR else (some, every)
        sized = any(part.smaller is not None for part in parts)
        return PValues(
            support([part.supported for part in parts]),
            refute([part.refuted for part in parts]),
            refute([part.size for part in parts]) if sized else None,
        )

    def describe(self) -> str:
        """Join the parts' sentences."""
        return f" {self.joint} ".join(f"({part.describe()})" for part in self.parts)

    def readings(self) -> tuple[TrialReading, ...]:
        """Return what the parts read."""
        return tuple(reading for part in self.parts for reading in part.readings())

    def plain(self) -> dict[str, Any]:
        """Return the kind and the parts."""
        return {"kind": self.kind, "parts": [part.plain() for part in self.parts]}

    def drawn(self) -> tuple[Source, ...]:
        """Return those of the parts."""
        return tuple({source.fingerprint: source for part in self.parts for source in part.drawn()}.values())

    def looks(self, design: Design) -> tuple[Look, ...]:
        """Return the looks that every part takes."""
        return min((part.looks(design) for part in self.parts), key=len)

    def attainable(self, n: int, design: Design) -> PValues:
        """Combine the parts' attainable p."""
        return self.combine([part.attainable(n, design) for part in self.parts])

    def bounds(self, trials: Trials, n: int, design: Design) -> tuple[PValues, PValues]:
        """Combine the parts' bounds; the lowest without correction, since a part may contradict itself without it."""
        lows, highs = zip(*(part.bounds(trials, n, design) for part in self.parts), strict=True)
        return self.combine(lows, corrected=False), self.combine(highs)

    def highest(self, trials: Trials, n: int, design: Design) -> PValues:
        """Combine the parts' highest p."""
        return self.combine([part.highest(trials, n, design) for part in self.parts])

    def find(self, trials: Trials, design: Design, alpha: float) -> Finding:
        """Judge every part; one that contradicts itself, significant both ways, decides nothing."""
        findings = [part.find(trials, design, alpha) for part in self.parts]
        undecided = PValues(1.0, 1.0)
        ps = [undecided if finding.p.contradict(alpha) else finding.p for finding in findings]
        several = len(self.parts) if self.weakest is Direction.AGAINST else 1
        return Finding(
            p=self.combine(ps),
            attainable=self.combine([finding.attainable for finding in findings]),
            describe=lambda: tuple(
                replace(entry, shares=entry.shares * several) for finding in findings for entry in finding.evidence
            ),
            deciding=lambda direction: self._deciding(findings, ps, direction),
        )

    def _deciding(self, findings: Sequence[Finding], ps: Sequence[PValues], direction: Direction) -> int:
        """Return the index, among all parts' evidence, of the entry that gives the compound's p."""
        choose = max if (direction is Direction.FOR) is (self.weakest is Direction.FOR) else min
        chosen = choose(range(len(findings)), key=lambda index: ps[index].toward(direction))
        before = sum(len(finding.evidence) for finding in findings[:chosen])
        return before + findings[chosen].deciding(direction)


@dataclass(frozen=True)
class AllOf(Compound):
    """All parts hold.

    Supported when every part is (intersection-union: no correction), refuted when some part is after Holm's.
    """

    kind: ClassVar[str] = "all of"
    entry: ClassVar[Entry] = Entry(
        syntax=("(a.reward > b.reward) & (a.reward > c.reward)",),
        null="One of the parts does not hold.",
        supported="Each part is supported at the same α. The intersection–union test needs no correction.",
        refuted="One part is refuted after Holm's correction, because each part is one more chance to err.",
        source="Berger 1982 (intersection–union test), Holm 1979",
    )
    joint: ClassVar[str] = "and"
    weakest: ClassVar[Direction] = Direction.FOR


@dataclass(frozen=True)
class AnyOf(Compound):
    """At least one part holds.

    Supported when some part is after Holm's correction, refuted when every part is.
    """

    kind: ClassVar[str] = "any of"
    entry: ClassVar[Entry] = Entry(
        syntax=("(a.reward > b.reward) | (a.reward > c.reward)",),
        null="None of the parts holds.",
        supported="One part is supported after Holm's correction.",
        refuted="Each part is refuted.",
        source="Holm 1979",
    )
    joint: ClassVar[str] = "or"
    weakest: ClassVar[Direction] = Direction.AGAINST
