"""What one trial leaves behind: a plain record that is stored as one JSON file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from evoclaims.core.canonical import as_plain, content_hash

Status = Literal["done", "diverged", "timeout", "crashed"]
COMPLETE: tuple[str, ...] = ("done", "diverged")
"""Statuses of trials that have come to their end, and whose metrics are all there."""
SCHEMA = 1


@dataclass(frozen=True)
class TrialResult:
    """The outcome of one trial.

    Attributes:
        id: hash of the trial's specification (`TrialSpec.id`).
        condition: hash of the specification without the seed.
        spec: the specification itself, as plain JSON.
        seed: the trial's seed.
        status: "done" when it ran to its end, "diverged" when a number stopped being finite, "timeout" when its batch
            took too long, "crashed" when it was ended from outside.
        metrics: final scalars of the champion and of the run, such as "mean_success" or "environment_steps".
        levels: per-level vectors of the champion, such as "success" with one value per level.
        curves: training curves; equally long lists, one value per report.
        digest: hash of everything above that is deterministic, and of the champion's parameters: equal digests
            mean the same trial to the bit.
        timing: seconds ("run", "compile", both shared by `batch` trials) and "started", "ended" (UTC, ISO 8601); of a
            trial that ran out of time also "limit", the seconds that its batch might take.
        provenance: versions, device, flags and git revision (see `core.provenance`).
        champion: SHA-256 of the stored champion's file, filled in by `Store.put`; empty while there is none.
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

    def to_json(self) -> dict[str, Any]:
        """Return the record as plain JSON, sealed with a hash that a torn or edited file fails."""
        plain: dict[str, Any] = {"schema": SCHEMA, **as_plain(self)}
        return {**plain, "seal": content_hash(plain)}


def digest(
    status: str,
    metrics: Mapping[str, float],
    levels: Mapping[str, tuple[float, ...]],
    curves: Mapping[str, tuple[float, ...]],
    champion: bytes,
) -> str:
    """Hash what a deterministic trial must reproduce to the bit; `champion` is the parameters' raw bytes."""
    return content_hash([status, dict(metrics), dict(levels), dict(curves), champion.hex()])
