"""The digest tripwire: the same seed, machine class and versions should give the same trial to the bit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from evoclaims.core.canonical import canonical_json
from evoclaims.trials.result import TrialResult


@dataclass(frozen=True)
class DigestChange:
    """A trial that is no longer what it was: changed, which need not mean wrong."""

    condition: str
    seed: int
    was: str
    now: str


@dataclass(frozen=True)
class DigestCheck:
    """What the tripwire found.

    Attributes:
        compared: new trials that had a comparable reference; with 0, the tripwire says nothing.
        changed: those of them whose digest differs.
    """

    compared: int
    changed: tuple[DigestChange, ...]


def compare_digests(new: Sequence[TrialResult], reference: Sequence[TrialResult]) -> DigestCheck:
    """Compare digests of trials of the same condition, seed, machine class and versions.

    Bit equality is promised on CPU only; a record whose provenance lacks the machine, the device's kind or the
    versions is comparable with nothing.
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
    """Return what two records must share to be comparable, or None for a record that does not say."""
    device = trial.provenance.get("device") or {}
    made_by = [device.get("kind"), trial.provenance.get("machine"), trial.provenance.get("versions")]
    if not all(made_by):
        return None
    return trial.condition, trial.seed, canonical_json(made_by)
