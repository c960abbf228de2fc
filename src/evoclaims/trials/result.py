"""The result of one trial: a plain record, stored as one JSON file."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, Literal

from evoclaims.core.canonical import content_hash
from evoclaims.core.errors import UserError

Status = Literal["done", "diverged", "timeout", "crashed"]
COMPLETE: tuple[str, ...] = ("done", "diverged")
"""Statuses of trials that ran to their end and have all their metrics."""
TRAINED_BY: Final = "trained_by"
"""Key of the provenance of a training loop's trial: the place of its function, "module:name"."""
RETURNED: Final = "returned"
"""Key of the same: hashes of the "metrics" that its function returned and of its policy's "actions" on fixed starts
(empty without a policy), whether some action is "graded", no whole number, and whether the trial "counts_steps" of the
environment, and not generations alone."""


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


SHARES: Final = ("mean_success", "last_success")
"""Names of a result's metrics that are successes."""

_ROUNDING: Final = 1e-6
"""What is so close to 1 and not 1 is a mean of ones, rounded."""


def is_share(number: float) -> bool:
    """Whether a finite number is a success: a share from 0 to 1, which a mean of ones may exceed by rounding."""
    return 0.0 <= number <= 1.0 + _ROUNDING


def check_success(
    what: str,
    *successes: float,
    name: str = "success",
    solves: bool = True,
    advice: str = "make the task's or the method's success such a share",
) -> None:
    """Check that successes are shares; those that are not finite are divergence, which is judged elsewhere.

    Args:
        what: reports them, such as "The examination of cma_es on n_parity".
        successes: of any number of levels or reports.
        name: of the metric or curve.
        solves: whether a level is solved by one that is exactly 1.
        advice: what to do, as the end of a sentence.

    Raises:
        UserError: when one is not.
    """
    rounded = [success for success in successes if 0.0 < abs(success - 1.0) <= _ROUNDING]
    if rounded and solves:
        raise UserError(
            f"{what} reports a {name} of {rounded[0]!r}, which is 1 except for rounding, and a level is "
            "solved at exactly 1. Average episodes by evoclaims.envs.averaged, or shares by "
            "evoclaims.envs.share."
        )
    wrong = [success for success in successes if math.isfinite(success) and not is_share(success)]
    if wrong:
        raise UserError(
            f"{what} reports a {name} of {wrong[0]:g}. A success is a share from 0 to 1, and a level is solved at "
            f"exactly 1: {advice}."
        )


def check_shares(what: str, metrics: Mapping[str, float], advice: str) -> None:
    """Check the metrics that are successes; arguments and errors are those of `check_success`."""
    for name in SHARES:
        if name in metrics:
            check_success(what, metrics[name], name=name, solves=False, advice=advice)
