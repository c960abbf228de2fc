"""What a claim asserts about trials: the interface of every kind, and the compounds with "and" and "or"."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NoReturn

from evoclaims.core.errors import UserError
from evoclaims.judging.multiplicity import holm
from evoclaims.judging.protocol import Look, Protocol
from evoclaims.judging.sample import Source, Trials
from evoclaims.judging.verdict import Evidence, PValues


@dataclass(frozen=True)
class Finding:
    """What an assertion finds in trials.

    Attributes:
        p: for and against the assertion.
        attainable: the smallest that n and the ties allow of each.
        evidence: one entry for each part.
    """

    p: PValues
    attainable: PValues
    evidence: tuple[Evidence, ...]


class Assertion(ABC):
    """One checkable sentence about trials; each kind is a frozen dataclass that fills in the abstract methods."""

    kind: ClassVar[str]

    @abstractmethod
    def describe(self) -> str:
        """Return the assertion in plain English."""

    @abstractmethod
    def sources(self) -> tuple[Source, ...]:
        """Return the conditions it needs, each once."""

    @abstractmethod
    def plain(self) -> dict[str, Any]:
        """Return the canonical description that the claim's fingerprint hashes, with the conditions' ids."""

    @abstractmethod
    def attainable(self, n: int, protocol: Protocol) -> PValues:
        """Return the smallest p, for and against, that `n` trials a side can give before any value is seen."""

    @abstractmethod
    def find(self, trials: Trials, protocol: Protocol, alpha: float) -> Finding:
        """Judge the trials at `alpha`.

        Raises:
            UnreadableTrialError: when a finished trial holds no number that can be judged.
        """

    def looks(self, protocol: Protocol) -> tuple[Look, ...]:
        """Return the looks that this kind takes: all of the protocol's unless it needs every trial at once."""
        return protocol.looks

    def bounds(self, trials: Trials, n: int, protocol: Protocol) -> tuple[PValues, PValues]:
        """Bound p over all completions of `trials` to `n` a side: the lowest and the highest, for and against.

        The bounds here hold for every kind. The rank tests keep them: with ties no single completion is extreme (a
        tie among new values can lower p below that of distinct ones), so nothing tighter is safe for them.
        """
        return self.attainable(n, protocol), PValues(1.0, 1.0)

    def __and__(self, other: Assertion) -> AllOf:
        """Assert both."""
        return AllOf((*_parts(self, AllOf), *_parts(other, AllOf)))

    def __or__(self, other: Assertion) -> AnyOf:
        """Assert at least one, with Holm's correction."""
        return AnyOf((*_parts(self, AnyOf), *_parts(other, AnyOf)))

    def __bool__(self) -> NoReturn:
        """Refuse to be true or false without a judge.

        Raises:
            TypeError: always.
        """
        raise TypeError("Write verdict(a > b); a bare assert would skip the exact judging.")


def _parts(value: object, joined_by: type[Compound]) -> tuple[Assertion, ...]:
    """Return the parts that `value` adds to a compound: flat, since nested corrections would multiply."""
    if not isinstance(value, Assertion):
        raise UserError(f"Only assertions are joined with & and |, not {value!r}: put each in parentheses.")
    return value.parts if isinstance(value, joined_by) else (value,)


def unique_sources(sources: Iterable[Source]) -> tuple[Source, ...]:
    """Return the sources without repeated fingerprints, in order."""
    return tuple({source.fingerprint: source for source in sources}.values())


@dataclass(frozen=True)
class Compound(Assertion):
    """Several assertions that are judged as one; a subclass says how their p values combine."""

    parts: tuple[Assertion, ...]
    joint: ClassVar[str]

    @staticmethod
    @abstractmethod
    def combine(parts: Sequence[PValues]) -> PValues:
        """Return the compound's p from its parts'; must never fall as a part's p rises."""

    def describe(self) -> str:
        """Join the parts' sentences."""
        return f" {self.joint} ".join(f"({part.describe()})" for part in self.parts)

    def sources(self) -> tuple[Source, ...]:
        """Return the parts' conditions."""
        return unique_sources(source for part in self.parts for source in part.sources())

    def plain(self) -> dict[str, Any]:
        """Return the kind and the parts."""
        return {"kind": self.kind, "parts": [part.plain() for part in self.parts]}

    def looks(self, protocol: Protocol) -> tuple[Look, ...]:
        """Return the looks that every part takes."""
        return min((part.looks(protocol) for part in self.parts), key=len)

    def attainable(self, n: int, protocol: Protocol) -> PValues:
        """Combine the parts' attainable p."""
        return self.combine([part.attainable(n, protocol) for part in self.parts])

    def bounds(self, trials: Trials, n: int, protocol: Protocol) -> tuple[PValues, PValues]:
        """Combine the parts' bounds."""
        bounds = [part.bounds(trials, n, protocol) for part in self.parts]
        return self.combine([low for low, _ in bounds]), self.combine([high for _, high in bounds])

    def find(self, trials: Trials, protocol: Protocol, alpha: float) -> Finding:
        """Judge every part."""
        findings = [part.find(trials, protocol, alpha) for part in self.parts]
        return Finding(
            p=self.combine([finding.p for finding in findings]),
            attainable=self.combine([finding.attainable for finding in findings]),
            evidence=tuple(entry for finding in findings for entry in finding.evidence),
        )


@dataclass(frozen=True)
class AllOf(Compound):
    """Supported when every part is (intersection-union: no correction), refuted when any part is."""

    kind: ClassVar[str] = "all of"
    joint: ClassVar[str] = "and"

    @staticmethod
    def combine(parts: Sequence[PValues]) -> PValues:
        """Take the weakest support and the strongest refutation."""
        return PValues(max(part.supported for part in parts), min(part.refuted for part in parts))


@dataclass(frozen=True)
class AnyOf(Compound):
    """Supported when some part is after Holm's correction, refuted when every part is."""

    kind: ClassVar[str] = "any of"
    joint: ClassVar[str] = "or"

    @staticmethod
    def combine(parts: Sequence[PValues]) -> PValues:
        """Take the strongest support, corrected, and the weakest refutation."""
        return PValues(min(holm([part.supported for part in parts])), max(part.refuted for part in parts))
