"""The matrix of claims and mutants: which planted faults each claim notices; `mutants.toml` beside a reproduction."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any, Final

import msgspec
import tomli_w

from evoclaims.core.errors import UserError
from evoclaims.core.files import read_file
from evoclaims.core.printable import printable
from evoclaims.judging.verdict import Outcome

FILE: Final = "mutants.toml"
SCHEMA: Final = 1


class Fate(StrEnum):
    """The result of trying a mutant on a claim."""

    KILLED = "killed by the verdict"
    DRIFTED = "killed by drift"
    SURVIVED = "survived"
    EQUIVALENT = "equivalent"
    BROKEN = "broken"


@dataclass(frozen=True)
class Attempt:
    """One mutant tried on one claim.

    Attributes:
        mutant: its name, such as "minimizes".
        target: the method or task that has the fault, as claims name it.
        outcome: of the claim, judged on the faulty trials.
        fate: killed by the verdict: the outcome differs from the one without the fault; killed by drift: the outcome is
            the same, but the drift check finds the fault; equivalent: the faulty trials equal the sound ones, so that
            no check can find it; broken: the faulty trials crashed, which says nothing about the claim.
    """

    mutant: str
    target: str
    outcome: Outcome
    fate: Fate

    @property
    def name(self) -> str:
        """A name such as "cma_es: minimizes"."""
        return f"{self.target}: {self.mutant}"


@dataclass(frozen=True)
class Sensitivity:
    """Which faults one claim notices.

    Attributes:
        outcome: without a fault.
        fingerprint: of what was judged.
        attempts: the mutants that were tried on its methods and tasks.
    """

    outcome: Outcome
    fingerprint: str
    attempts: tuple[Attempt, ...]

    def named(self, fate: Fate) -> tuple[str, ...]:
        """Return the mutants with a fate."""
        return tuple(attempt.name for attempt in self.attempts if attempt.fate is fate)

    @property
    def insensitive(self) -> bool:
        """Whether mutants were tried and none changed the verdict: the claim tests nothing that it names."""
        counted = [one for one in self.attempts if one.fate not in (Fate.EQUIVALENT, Fate.BROKEN)]
        return bool(counted) and not self.named(Fate.KILLED)

    def unnoticed(self, targets: Sequence[str]) -> tuple[str, ...]:
        """Return the targets whose mutants all left the verdict unchanged."""
        noticed = {one.target for one in self.attempts if one.fate is Fate.KILLED}
        return tuple(target for target in targets if target not in noticed)


Matrix = Mapping[tuple[str, str], Sensitivity]
"""By tier and claim, such as ("smoke", "G1[n_parity]")."""


def fate(sound: Outcome, faulty: Outcome, *, equivalent: bool, drifted: bool) -> Fate:
    """Return the fate of a mutant.

    Args:
        sound: the claim's outcome without the fault.
        faulty: its outcome with it.
        equivalent: whether all faulty trials equal the sound ones.
        drifted: whether the drift check finds that a condition of the claim has drifted.
    """
    if equivalent:
        return Fate.EQUIVALENT
    if faulty in (Outcome.ERROR, Outcome.NOT_RUN):
        return Fate.BROKEN
    if faulty is not sound:
        return Fate.KILLED
    return Fate.DRIFTED if drifted else Fate.SURVIVED


@dataclass(frozen=True)
class MutationScore:
    """How many mutants are noticed; equivalent and broken ones do not count.

    Attributes:
        mutants: pairs of fault and target that were tried.
        by_verdict: those that change the verdict of at least one claim.
        by_drift: those that change none but are found by the drift check.
        claims: that mutants were tried on.
        insensitive: claims that no mutant changed.
    """

    mutants: int
    by_verdict: int
    by_drift: int
    claims: int
    insensitive: tuple[str, ...]

    def __str__(self) -> str:
        """Return one line for a table's foot."""
        return (
            f"{self.by_verdict} of {self.mutants} mutants change a verdict, {self.by_drift} more are told by the drift "
            f"check; {len(self.insensitive)} of {self.claims} claims are changed by none of those tried"
        )


def score(matrix: Matrix, tier: str) -> MutationScore:
    """Return the mutation score of a tier."""
    rows = {claim: row for (one, claim), row in matrix.items() if one == tier}
    fates: dict[tuple[str, str], set[Fate]] = {}
    for row in rows.values():
        for attempt in row.attempts:
            fates.setdefault((attempt.mutant, attempt.target), set()).add(attempt.fate)
    tried = [found for found in fates.values() if found - {Fate.EQUIVALENT, Fate.BROKEN}]
    killed = sum(Fate.KILLED in found for found in tried)
    return MutationScore(
        mutants=len(tried),
        by_verdict=killed,
        by_drift=sum(Fate.DRIFTED in found and Fate.KILLED not in found for found in tried),
        claims=len(rows),
        insensitive=tuple(claim for claim, row in rows.items() if row.insensitive),
    )


def load(path: Path) -> Matrix:
    """Read a matrix; empty if there is no such file.

    Raises:
        UserError: when the file holds no matrix.
    """
    try:
        plain = tomllib.loads(read_file(path).decode())
        if plain.pop("schema", None) != SCHEMA:
            raise ValueError(f"this version of evoclaims reads schema {SCHEMA}")
        rows = msgspec.convert(plain, dict[str, dict[str, Sensitivity]])
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, RecursionError) as error:
        raise UserError(
            f"{path} holds no matrix of mutants: {printable(error)}. Restore it from version control, or write it anew "
            "with `evoclaims mutants`."
        ) from error
    return {(tier, claim): row for tier, claims in rows.items() for claim, row in claims.items()}


def dump(matrix: Matrix) -> str:
    """Return a matrix as TOML."""
    tiers: dict[str, dict[str, Any]] = {}
    for (tier, claim), row in sorted(matrix.items()):
        tiers.setdefault(tier, {})[printable(claim)] = msgspec.to_builtins(row)
    return "# Written by `evoclaims mutants`.\n" + tomli_w.dumps({"schema": SCHEMA, **tiers})
