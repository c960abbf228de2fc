"""exact: an event holds in every trial. A fact about deterministic controls, not a test."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from evoclaims.judging.assertion import Assertion, Finding
from evoclaims.judging.protocol import Look, Protocol
from evoclaims.judging.sample import Source, Trials
from evoclaims.judging.verdict import Evidence, PValues

if TYPE_CHECKING:
    from evoclaims.judging.measure import Event


@dataclass(frozen=True)
class EveryTrial(Assertion):
    """Supported when the event holds in every trial of the protocol's last look, refuted otherwise."""

    event: Event
    kind: ClassVar[str] = "exact"

    def describe(self) -> str:
        """Return "E in every trial"."""
        return f"{self.event.describe()} in every trial"

    def sources(self) -> tuple[Source, ...]:
        """Return the condition."""
        return (self.event.source,)

    def plain(self) -> dict[str, Any]:
        """Return the kind and the event."""
        return {"kind": self.kind, "event": self.event.plain()}

    def looks(self, protocol: Protocol) -> tuple[Look, ...]:
        """Return the last look alone: "every" needs every trial."""
        return (protocol.last,)

    def attainable(self, n: int, protocol: Protocol) -> PValues:
        """Return zeros: a fact can come out either way at any n."""
        return PValues(0.0, 0.0)

    def find(self, trials: Trials, protocol: Protocol, alpha: float) -> Finding:
        """Look whether it holds; "p" is 0 for what is so and 1 for what is not, and is not reported."""
        sample = self.event.sample(trials)
        missed = tuple(seed for seed, value in zip(sample.seeds, sample.values, strict=True) if not value)
        p = PValues(1.0, 0.0) if missed else PValues(0.0, 1.0)
        evidence = Evidence(
            kind=self.kind,
            describe=self.describe(),
            outcome=p.outcome(alpha),
            samples=(sample,),
            n=len(sample.values),
            alpha=alpha,
            p=None,
            attainable_p=None,
            p_refuted=None,
            attainable_p_refuted=None,
            detail=f"does not hold for seeds {', '.join(map(str, missed))}" if missed else "holds in every trial",
        )
        return Finding(p, PValues(0.0, 0.0), (evidence,))
