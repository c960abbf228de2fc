"""Which conclusions depend on a detail: claims under variants of the protocol."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from evoclaims.judging.verdict import Outcome
from evoclaims.verdicts.claim_report import ClaimReport


@dataclass(frozen=True)
class Robustness:
    """One claim under the protocol and its variants.

    Attributes:
        claim: id and parameters, such as "G1[n_parity]".
        tier: "smoke" or "full".
        plain: the verdict under the protocol itself.
        outcomes: by variant; a variant that changes none of the claim's trials, or whose trials have not run, is left
            out.
    """

    claim: str
    tier: str
    plain: Outcome
    outcomes: Mapping[str, Outcome]

    @property
    def hangs_on(self) -> tuple[str, ...]:
        """Variants whose verdict is another one than the protocol's; none where the protocol itself has not run."""
        if self.plain is Outcome.NOT_RUN:
            return ()
        return tuple(name for name, outcome in self.outcomes.items() if outcome != self.plain)


def matrix(plain: Sequence[ClaimReport], variants: Mapping[str, Sequence[ClaimReport]]) -> tuple[Robustness, ...]:
    """Return a row for each claim that some variant touches, from reports under the protocol itself and by variant."""
    found = {
        (report.tier, report.name, name): report.outcome
        for name, reports in variants.items()
        for report in reports
        if report.outcome != Outcome.NOT_RUN
    }
    rows = [
        Robustness(
            report.name,
            report.tier,
            report.outcome,
            {name: found[key] for name in variants if (key := (report.tier, report.name, name)) in found},
        )
        for report in plain
    ]
    return tuple(row for row in rows if row.outcomes)
