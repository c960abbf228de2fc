"""The result of one trial: a plain record, stored as one JSON file."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, Literal

from evoclaims.core.canonical import as_plain, content_hash

Status = Literal["done", "diverged", "timeout", "crashed"]
COMPLETE: tuple[str, ...] = ("done", "diverged")
"""Statuses of trials that ran to their end and have all their metrics."""
SCHEMA = 1
TRAINED_BY: Final = "trained_by"
"""Key of the provenance of a training loop's trial: the place of its function, "module:name"."""
RETURNED: Final = "returned"
"""Key of the same: hashes of the "metrics" that its function returned and of its policy's "actions" on fixed starts
(empty without a policy), and whether some action is "graded", no whole number."""


@dataclass(frozen=True)
class TrialResult:
    """The outcome of one trial.

    Attributes:
        id: hash of the trial's specification (`TrialSpec.id`).
        condition: hash of the specification without the seed.
        spec: the specification itself, as plain JSON.
        seed: the trial's seed.
        status: "done" when it ran to its end, "diverged" when a number was no longer finite, "timeout" when its batch
            took too long, "crashed" when it was killed.
        metrics: final scalars of the champion and of the run, such as "mean_success" or "environment_steps".
        levels: per-level vectors of the champion, such as "success" with one value per level.
        curves: training curves; lists of equal length, one value per report.
        digest: hash of everything above that is deterministic, and of the champion's parameters: equal digests
            mean bit-identical trials.
        timing: seconds ("run", "compile", both shared by `batch` trials) and "started", "ended" (UTC, ISO 8601); for
            a timed-out trial also "limit", the seconds that its batch was allowed; on a processor "processor", the
            seconds of its cores that running took.
        provenance: versions, device, flags and git revision (see `core.provenance`).
        champion: SHA-256 of the stored champion's file, filled in by `Store.put`; empty until then.
    """

    id: str
    condition: str
    spec: Mapping[str, Any]
    seed: int
    status: Status
    metrics: Mapping[str, float]
    levels: Mapping[str, tuple[float, ...]]
    curves: Mapping[str, tuple[float, ...]]
    digest: str
    timing: Mapping[str, Any]
    provenance: Mapping[str, Any]
    champion: str = ""

    @cached_property
    def curves_hash(self) -> str:
        """SHA-256 of the training curves: equal for curves that are equal in every bit, NaN included."""
        return hashlib.sha256(repr(sorted(self.curves.items())).encode()).hexdigest()

    @property
    def device(self) -> Mapping[str, Any]:
        """Platform, kind and count of the devices that made the trial; empty in a record that does not say."""
        return self.provenance.get("device") or {}

    @property
    def seed_in_words(self) -> str:
        """The seed, and that by which the trial is known in the table that it was imported from, if another."""
        known = self.provenance.get("seed_in_table", str(self.seed))
        return str(self.seed) if known == str(self.seed) else f"{self.seed} ({known} in the table)"

    def to_json(self) -> dict[str, Any]:
        """Return the record as plain JSON, sealed with a hash that detects torn or edited files."""
        plain: dict[str, Any] = {"schema": SCHEMA, **as_plain(self)}
        return {**plain, "seal": content_hash(plain)}


def matches_digest(result: TrialResult, packed: bytes) -> bool:
    """Whether a record's digest is that of its contents; `packed` is the champion's file, empty without one.

    A seal and a digest show that a record was not changed by accident. Whoever writes both can write any record.
    """
    champion = packed or str(result.provenance.get("crash") or "").encode()  # see `result_making.make_unfinished`
    return digest(result.status, result.metrics, result.levels, result.curves, champion) == result.digest


def digest(
    status: str,
    metrics: Mapping[str, float],
    levels: Mapping[str, tuple[float, ...]],
    curves: Mapping[str, tuple[float, ...]],
    champion: bytes,
) -> str:
    """Hash what a deterministic trial must reproduce to the bit; `champion` is the parameters' raw bytes."""
    return content_hash([status, dict(metrics), dict(levels), dict(curves), champion.hex()])
