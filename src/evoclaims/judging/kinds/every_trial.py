"""exact: an event holds in every trial. A fact about deterministic controls, not a test."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from evoclaims.judging.assertion import Assertion, Entry, Finding
from evoclaims.judging.design import Design, Look
from evoclaims.judging.reading import EventReading
from evoclaims.judging.sample import Source, Trials
from evoclaims.judging.verdict import PValues


@dataclass(frozen=True)
class EveryTrial(Assertion):
    """An event holds in every trial.

    Supported when it holds in every trial of the design's last look, refuted otherwise.
    """

    event: EventReading
    kind: ClassVar[str] = "exact"
    entry: ClassVar[Entry] = Entry(
        syntax=("a.solves_every_level.in_every_trial()",),
        null="None, because nothing is tested. Use it for trials without randomness, such as those of a control.",
        supported="The event holds in each trial of the last look.",
        refuted="The event does not hold in one of them.",
        source="No test",
    )

    def describe(self) -> str:
        """Return "E in every trial"."""
        return f"{self.event.describe()} in every trial"

    def drawn(self) -> tuple[Source, ...]:
        """Return none: a fact about trials that are copies of each other is as true."""
        return ()

    def looks(self, design: Design) -> tuple[Look, ...]:
        """Return only the last look: "every" needs every trial."""
        return (design.last,)

    def attainable(self, n: int, design: Design) -> PValues:
        """Return zeros: a fact can be true or false at any n."""
        return PValues(0.0, 0.0)

    def highest(self, trials: Trials, n: int, design: Design) -> PValues:
        """Return whether a trial that is known fails it: then no other result changes that."""
        return PValues(1.0, 1.0 if all(self.event.sample(trials).values) else 0.0)

    def find(self, trials: Trials, design: Design, alpha: float) -> Finding:
        """Check whether it holds."""
        sample = self.event.sample(trials)
        pairs = zip(trials[self.event.source.fingerprint], sample.values, strict=True)
        missed = [trial.seed_in_words for trial, value in pairs if not value]
        detail = f"does not hold for seeds {', '.join(missed)}" if missed else "holds in every trial"
        return self.fact(not missed, alpha, sample, detail, events=True)
