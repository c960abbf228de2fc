"""The digest tripwire: the same seed, machine class and versions should give bit-identical trials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from evoclaims.core.canonical import canonical_json
from evoclaims.trials.result import TrialResult


@dataclass(frozen=True)
class DigestChange:
    """A trial whose digest has changed, which need not mean that it is wrong."""

    condition: str
    seed: int
    was: str
    now: str


@dataclass(frozen=True)
class DigestCheck:
    """What the tripwire found.

    Attributes:
        compared: new trials with a comparable reference; if 0, the check shows nothing.
        changed: those of them whose digest differs.
    """

    compared: int
    changed: tuple[DigestChange, ...]


def compare_digests(new: Sequence[TrialResult], reference: Sequence[TrialResult]) -> DigestCheck:
    """Compare digests of trials of the same condition, seed, machine class and versions.

    Bit equality is guaranteed on CPU only; a record whose provenance lacks the machine, the device kind or the
    versions cannot be compared.
    """
    stored = {key: trial for trial in reference if (key := _comparable_key(trial)) is not None}
    pairs = [(trial, stored[key]) for trial in new if (key := _comparable_key(trial)) in stored and key is not None]
    changed = tuple(
        DigestChange(trial.condition, trial.seed, old.digest, trial.digest)
        for trial, old in pairs
        if trial.digest != old.digest
    )
    return DigestCheck(len(pairs), changed)


def _comparable_key(trial: TrialResult) -> tuple[str, int, str] | None:
    """Return what two records must share to be comparable, or None if the record does not have it."""
    made_by = [trial.device.get("kind"), trial.provenance.get("machine"), trial.provenance.get("versions")]
    if not all(made_by):
        return None
    return trial.condition, trial.seed, canonical_json(made_by)
