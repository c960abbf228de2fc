"""The matrix of claims and mutants: which planted faults each claim notices; `mutants.toml` beside a reproduction."""

from __future__ import annotations

import tomllib
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any, Final, Literal, get_args

import msgspec
import tomli_w

from evoclaims.core.errors import UserError
from evoclaims.core.files import read_file
from evoclaims.core.printable import printable
from evoclaims.judging.verdict import Outcome
from evoclaims.verdicts.claim_report import ClaimReport, Tried
from evoclaims.verdicts.history import key_of

FILE: Final = "mutants.toml"
SCHEMA: Final = 1

Part = Literal["method", "task"]
"""What has a fault."""


class Fate(StrEnum):
    """The result of trying a mutant on a claim."""

    KILLED = "killed by the verdict"
    DRIFTED = "killed by drift"
    SURVIVED = "survived"
    EQUIVALENT = "equivalent"
    BROKEN = "broken"

    @property
    def symbol(self) -> str:
        """One character for the grid."""
        return _SYMBOLS[self]

    @property
    def counts(self) -> bool:
        """Whether a check could have noticed the fault, and trials say whether it did."""
        return self not in (Fate.EQUIVALENT, Fate.BROKEN)


_SYMBOLS: Final = {
    Fate.KILLED: "●",
    Fate.DRIFTED: "◐",
    Fate.SURVIVED: "○",
    Fate.EQUIVALENT: "=",
    Fate.BROKEN: "!",
}


@dataclass(frozen=True)
class Attempt:
    """One mutant tried on one claim.

    Attributes:
        mutant: its name, such as "minimizes".
        part: what has the fault.
        target: the method or task that has it, as claims name it.
        outcome: of the claim with the fault, if that changed it; else the claim's own.
        fate: killed by the verdict: the outcome differs from the one without the fault; killed by drift: the outcome is
            the same, but the drift check finds the fault; equivalent: the faulty trials equal the sound ones, so that
            no check can find it; broken: the faulty trials crashed or ran out of time, or the claim became an error.
    """

    mutant: str
    part: Part
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
        methods: those that the claim names.
        attempts: the mutants that were tried on its methods and tasks.
        untried: names of those that were not.
    """

    outcome: Outcome
    fingerprint: str
    methods: tuple[str, ...]
    attempts: tuple[Attempt, ...]
    untried: tuple[str, ...] = ()

    def named(self, fate: Fate) -> tuple[str, ...]:
        """Return the mutants with a fate."""
        return tuple(attempt.name for attempt in self.attempts if attempt.fate is fate)

    @property
    def tried(self) -> Tried:
        """Whether a fault of the methods that the claim names changes its verdict.

        Where no fault of its methods can be noticed, since they never learn, those of its tasks count instead. While
        some mutants are untried, only a change by a fault of its methods says something.
        """
        counted = [attempt for attempt in self.attempts if attempt.fate.counts]
        considered = [attempt for attempt in counted if attempt.part == "method"]
        if not self.untried:
            considered = considered or counted
        if any(attempt.fate is Fate.KILLED for attempt in considered):
            return Tried.SENSITIVE
        return Tried.INSENSITIVE if considered and not self.untried else Tried.NOT_TRIED

    @property
    def unnoticed(self) -> tuple[str, ...]:
        """The methods that the claim names, and none of whose own faults changes its verdict."""
        own = (one for one in self.attempts if one.part == "method" and one.fate.counts)
        noticed = {one.target for one in own if one.fate is Fate.KILLED}
        return tuple(method for method in self.methods if method not in noticed)


Matrix = Mapping[tuple[str, str], Sensitivity]
"""By tier and claim, such as ("smoke", "G1[n_parity]")."""


def current(matrix: Matrix, report: ClaimReport) -> Sensitivity | None:
    """Return a claim's row if it is about this verdict: the same conditions, rules and outcome; else None."""
    row = None if report.variant else matrix.get(key_of(report))
    return row if row is not None and (row.fingerprint, row.outcome) == (report.fingerprint, report.outcome) else None


def tried(matrix: Matrix, report: ClaimReport) -> Tried:
    """Return whether planted faults change a claim's verdict; "not tried" where no row is about it."""
    row = current(matrix, report)
    return Tried.NOT_TRIED if row is None else row.tried


def described(matrix: Matrix, report: ClaimReport) -> str:
    """Return a sentence on which planted faults change a claim's verdict."""
    row = current(matrix, report)
    if row is None or row.tried is Tried.NOT_TRIED:
        return "Planted faults: not tried."
    fates = [attempt.fate for attempt in row.attempts if attempt.fate.counts]
    text = f"Planted faults: {fates.count(Fate.KILLED)} of {len(fates)} change this verdict"
    if row.unnoticed and not row.untried:
        text += f", none of those in {' or '.join(row.unnoticed)}"
    return f"Insensitive. {text}." if row.tried is Tried.INSENSITIVE else f"{text}."


def fate(sound: Outcome, faulty: Outcome, *, equivalent: bool, drifted: bool) -> Fate:
    """Return the fate of a mutant.

    Args:
        sound: the claim's outcome without the fault.
        faulty: its outcome with it.
        equivalent: whether all faulty trials equal the sound ones in levels, metrics and curves that the claim reads.
        drifted: whether the drift check finds that a condition of the claim has drifted.
    """
    if equivalent and faulty is sound:
        return Fate.EQUIVALENT
    if not faulty.judged:
        return Fate.BROKEN
    if faulty is not sound:
        return Fate.KILLED
    return Fate.DRIFTED if drifted else Fate.SURVIVED


def load(path: Path) -> Matrix:
    """Read a matrix; empty if there is no such file.

    Raises:
        UserError: when the file holds no matrix.
    """
    try:
        plain = tomllib.loads(read_file(path).decode())
        if plain.pop("schema", None) != SCHEMA:
            raise ValueError(f"this version of evoclaims reads schema {SCHEMA}")
        tiers = msgspec.convert(plain, dict[str, dict[str, _Written]])
        return {(tier, claim): _read(row) for tier, rows in tiers.items() for claim, row in rows.items()}
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, RecursionError) as error:
        raise UserError(
            f"{path} holds no matrix of mutants: {printable(error)}. Restore it from version control, or remove it and "
            "write it anew with `evoclaims mutants`."
        ) from error


def dump(matrix: Matrix) -> str:
    """Return a matrix as TOML, with one line for each attempt."""
    tiers: dict[str, dict[str, Any]] = {}
    for (tier, claim), row in sorted(matrix.items()):
        tiers.setdefault(tier, {})[printable(claim)] = msgspec.to_builtins(_written(row))
    return "# Written by `evoclaims mutants`.\n" + tomli_w.dumps({"schema": SCHEMA, **tiers})


@dataclass(frozen=True)
class _Written:
    """A row as the file has it: what each fault did, by method or task; "refuted" where it made the claim so."""

    outcome: Outcome
    fingerprint: str
    untried: tuple[str, ...]
    method: dict[str, dict[str, str]]
    task: dict[str, dict[str, str]]


def _written(row: Sensitivity) -> _Written:
    written = _Written(row.outcome, row.fingerprint, row.untried, {name: {} for name in row.methods}, {})
    for one in row.attempts:
        text = str(one.outcome if one.fate is Fate.KILLED else one.fate)
        getattr(written, one.part).setdefault(one.target, {})[one.mutant] = text
    return written


def _read(written: _Written) -> Sensitivity:
    """Return a row of the file; a `ValueError` for what is neither an outcome nor a fate."""

    def attempt(part: Part, target: str, mutant: str, text: str) -> Attempt:
        if text in set(Outcome):
            return Attempt(mutant, part, target, Outcome(text), Fate.KILLED)
        return Attempt(mutant, part, target, written.outcome, Fate(text))

    attempts = (
        attempt(part, target, mutant, text)
        for part in get_args(Part)
        for target, faults in getattr(written, part).items()
        for mutant, text in faults.items()
    )
    return Sensitivity(written.outcome, written.fingerprint, tuple(written.method), tuple(attempts), written.untried)


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
    partly = sum(row.tried is Tried.SENSITIVE and bool(row.unnoticed) and not row.untried for row in rows)
    return (
        f"Mutation score ({tier}): {by_verdict} of {len(fates)} planted faults change a verdict, "
        f"{by_drift} more are found by the drift check; of {len(rows) - found[Tried.NOT_TRIED]} claims "
        f"{found[Tried.INSENSITIVE]} are insensitive, and {partly} notice faults in some of their methods alone."
    )
