"""How many planted faults the claims of a tier notice."""

from __future__ import annotations

from collections import Counter

from evoclaims.verdicts.mutation_matrix import Fate, Matrix
from evoclaims.verdicts.sensitivity import Tried


def score(matrix: Matrix, tier: str) -> str:
    """Return in a sentence how many planted faults change the verdict of some claim, or are found by drift alone.

    Equivalent and broken mutants do not count; a fault in two targets counts twice. Claims are insensitive whose
    verdicts no mutant changes; others may name a method none of whose own mutants changes their verdicts.
    """
    rows = [row for (one, _), row in matrix.items() if one == tier]
    fates: dict[tuple[str, str], set[Fate]] = {}
    for attempt in (attempt for row in rows for attempt in row.attempts if attempt.fate.counts):
        fates.setdefault((attempt.mutant, attempt.target), set()).add(attempt.fate)
    if not fates:
        return f"Mutation score ({tier}): not tried."
    by_verdict = sum(Fate.KILLED in found for found in fates.values())
    by_drift = sum(Fate.DRIFTED in found and Fate.KILLED not in found for found in fates.values())
    found = Counter(row.tried for row in rows)
    partly = sum(row.tried is Tried.SENSITIVE and bool(row.unnoticed) for row in rows)
    return (
        f"Mutation score ({tier}): {by_verdict} of {len(fates)} planted faults change a verdict, "
        f"{by_drift} more are found by the drift check; of {len(rows) - found[Tried.NOT_TRIED]} claims "
        f"{found[Tried.INSENSITIVE]} are insensitive, and {partly} notice faults in some of their methods alone."
    )
