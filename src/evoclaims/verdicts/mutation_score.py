"""How many planted faults the claims of a tier notice, in numbers and in a sentence."""

from __future__ import annotations

from dataclasses import dataclass

from evoclaims.verdicts.mutation_matrix import Fate, Matrix
from evoclaims.verdicts.sensitivity import Tried


@dataclass(frozen=True)
class MutationScore:
    """How many mutants are noticed; equivalent and broken ones do not count.

    Attributes:
        tier: of the claims.
        mutants: pairs of fault and target that were tried.
        by_verdict: those that change the verdict of at least one claim.
        by_drift: those that change none but are found by the drift check.
        claims: that mutants were tried on.
        insensitive: claims whose verdicts no mutant changes.
        partly: other claims that name a method none of whose own mutants changes their verdicts.
    """

    tier: str
    mutants: int
    by_verdict: int
    by_drift: int
    claims: int
    insensitive: tuple[str, ...]
    partly: tuple[str, ...]

    def __str__(self) -> str:
        """Return the mutation score in a line."""
        if not self.mutants:
            return f"Mutation score ({self.tier}): not tried."
        return (
            f"Mutation score ({self.tier}): {self.by_verdict} of {self.mutants} planted faults change a verdict, "
            f"{self.by_drift} more are found by the drift check; of {self.claims} claims {len(self.insensitive)} are "
            f"insensitive, and {len(self.partly)} notice faults in some of their methods alone."
        )


def score(matrix: Matrix, tier: str) -> MutationScore:
    """Return the mutation score of a tier."""
    rows = {claim: row for (one, claim), row in matrix.items() if one == tier}
    fates: dict[tuple[str, str], set[Fate]] = {}
    for row in rows.values():
        for attempt in row.attempts:
            if attempt.fate.counts:
                fates.setdefault((attempt.mutant, attempt.target), set()).add(attempt.fate)
    killed = sum(Fate.KILLED in found for found in fates.values())
    return MutationScore(
        tier=tier,
        mutants=len(fates),
        by_verdict=killed,
        by_drift=sum(Fate.DRIFTED in found and Fate.KILLED not in found for found in fates.values()),
        claims=sum(row.tried is not Tried.NOT_TRIED for row in rows.values()),
        insensitive=tuple(claim for claim, row in rows.items() if row.tried is Tried.INSENSITIVE),
        partly=tuple(claim for claim, row in rows.items() if row.tried is Tried.SENSITIVE and row.unnoticed),
    )
