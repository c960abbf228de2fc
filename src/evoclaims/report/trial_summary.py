"""Trials for a report: what is shown of each, and where it was made, in words."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from evoclaims.core.errors import UserError
from evoclaims.core.packages import DEPENDS_ON, Versions
from evoclaims.paper.archive import Archive
from evoclaims.report.formatting import clean, counted, listed, plural
from evoclaims.trials.result import TRAINED_BY, TrialResult

SHORT: Final = 9
"""Digits of a revision that are shown."""


@dataclass(frozen=True)
class Origin:
    """What a trial's provenance says.

    Attributes:
        device: such as "NVIDIA H200 (gpu)".
        machine: operating system, architecture and processor.
        revision: of the code; empty when unknown.
        dirty: whether the code differed from that revision; None when unknown.
        versions: of packages, by name; those that are absent are left out.
        settings: what else results depend on, by name.
    """

    device: str
    machine: str
    revision: str
    dirty: bool | None
    versions: tuple[tuple[str, str], ...]
    settings: tuple[tuple[str, str], ...]

    @staticmethod
    def of(provenance: Mapping[str, Any]) -> Origin:
        """Read a record's provenance."""
        device, git = provenance.get("device") or {}, provenance.get("git") or {}
        kind, platform = clean(device.get("kind") or ""), clean(device.get("platform") or "")
        known = " ".join([kind, f"({platform})" if platform not in ("", kind) else ""]).strip()
        rest = provenance.keys() - {"device", "git", "machine", "versions", "seed_in_table", DEPENDS_ON}
        return Origin(
            device=known or _imported(provenance.get("imported") or {}) or "unknown device",
            machine=clean(provenance.get("machine") or "unknown machine"),
            revision=clean(git.get("sha") or ""),
            dirty=git.get("dirty"),
            versions=_pairs(provenance.get("versions") or {}),
            settings=_pairs({name: provenance[name] for name in sorted(rest)}),
        )

    @property
    def code(self) -> str:
        """The revision in short, with what is known about changes to it."""
        state = {True: "with uncommitted changes", False: "clean", None: "changes unknown"}[self.dirty]
        return f"{self.revision[:SHORT]}, {state}" if self.revision else "unknown revision"


def warnings(made: Counter[Origin]) -> tuple[str, ...]:
    """Return what a reader should know before trusting the trials together: sentences, none when all is well."""
    every = list(made.elements())
    found = []
    if len({origin.device for origin in every}) > 1:
        found.append(f"Trials from mixed devices: {counted(origin.device for origin in every)}.")
    dirty = sum(origin.dirty is True for origin in every)
    if dirty:
        found.append(f"{plural(dirty, 'trial')} of {len(every)} ran code with uncommitted changes.")
    unknown = sum(not origin.revision for origin in every)
    if unknown:
        found.append(f"{plural(unknown, 'trial')} of {len(every)} ran code of unknown revision.")
    return tuple(found)


def _imported(table: Mapping[str, Any]) -> str:
    """Say where imported trials come from; empty for others."""
    if not table:
        return ""
    digits = str(table.get("sha256", ""))[:SHORT]
    return clean(f"an unknown device (imported from {table.get('file')}, sha256 {digits}, by {table.get('by')})")


def _pairs(values: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    """Return names and values as texts, without absent ones."""
    return tuple((clean(name), _text(value)) for name, value in values.items() if value not in (None, "", {}, []))


def _text(value: Any) -> str:
    if isinstance(value, dict):
        return listed((f"{name} {_text(part)}" for name, part in value.items()), most=40)
    return clean(value)


AXES: Final = ("environment_steps", "steps")
"""Curves that count the spent budget; the first is what others are drawn over."""

POINTS: Final = 100
"""Most points of a training curve that are kept."""


@dataclass(frozen=True, eq=False)
class Curve:
    """One quantity of a trial over its training.

    Attributes:
        x, y: at most `POINTS` evenly spread points of those that are finite, the first and the last among them, and one
            that is not for each stretch between, before or after them that was not finite: a gap.
        reported: how many numbers it has, finite or not.
        constant: the value of all of them; None if they differ, or there are none.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    reported: int
    constant: float | None

    @staticmethod
    def of(x: NDArray[np.float64], y: NDArray[np.float64]) -> Curve:
        """Thin what was reported."""
        finite, broken = np.flatnonzero(np.isfinite(y)), np.flatnonzero(~np.isfinite(y))
        if len(finite) > POINTS:
            finite = finite[np.linspace(0, len(finite) - 1, POINTS).round().astype(int)]
        _, gaps = np.unique(np.searchsorted(finite, broken), return_index=True)
        kept = np.union1d(finite, broken[gaps])
        same = len(y) > 0 and np.array_equal(y, np.full_like(y, y[0]), equal_nan=True)
        return Curve(x[kept], y[kept], len(y), float(y[0]) if same else None)


@dataclass(frozen=True, eq=False)
class TrialSummary:
    """One trial.

    Attributes:
        trial: its id.
        seed, seed_in_words, status: as in its record.
        score: the "mean_success" metric; None without it.
        origin: where it was made.
        reports: how many points its curves have.
        curves: by name; none where the steps are unknown that they are drawn over.
    """

    trial: str
    seed: int
    seed_in_words: str
    status: str
    score: float | None
    origin: Origin
    reports: int
    curves: Mapping[str, Curve]


class Reader:
    """Reads trials by id, each once."""

    def __init__(self, archive: Archive) -> None:
        """Read from `archive`."""
        self._archive = archive
        self._read: dict[str, TrialSummary | None] = {}
        self._origins: dict[Origin, Origin] = {}
        self.settings: dict[str, Mapping[str, Any]] = {}
        """What was run, as plain JSON, by the condition's id."""
        self.troubles: dict[str, None] = {}
        """Why trials could not be read: sentences in order of appearance."""

    def read(self, trials: Sequence[str], versions: Versions | None = None) -> tuple[TrialSummary, ...]:
        """Return the trials that can be read; `troubles` says why others cannot.

        Args:
            trials: ids.
            versions: if a trial has several records, one made with these comes first (see `Archive.get`).
        """
        summaries = (self._one(trial, versions) for trial in trials)
        return tuple(summary for summary in summaries if summary is not None)

    def _one(self, trial: str, versions: Versions | None) -> TrialSummary | None:
        if trial not in self._read:
            try:
                found = self._archive.get(trial, versions)
            except UserError as error:
                self.troubles[str(error)] = None
                found = None
            self._read[trial] = None if found is None else self._summary(found)
        return self._read[trial]

    def _summary(self, found: TrialResult) -> TrialSummary:
        self.settings.setdefault(found.condition, {k: v for k, v in found.spec.items() if k != "seed"})
        origin = Origin.of(found.provenance)
        return TrialSummary(
            trial=found.id,
            seed=found.seed,
            seed_in_words=found.seed_in_words,
            status=found.status,
            score=found.metrics.get("mean_success"),
            origin=self._origins.setdefault(origin, origin),
            reports=max(map(len, found.curves.values()), default=0),
            curves=_curves(found),
        )


def _curves(trial: TrialResult) -> dict[str, Curve]:
    """Return the curves of a trial, each of the numbers that were reported.

    Where a table has an empty cell, or a training loop's report lacks a number, nothing was logged: a record has NaN
    there, and the curve goes on. Where NaN was or may have been reported there is a gap: of a method, which reports all
    numbers each time, of a loop that has diverged, and at the end of a table's metric that is NaN.
    """
    every = {name: np.asarray(curve, np.float64) for name, curve in trial.curves.items()}
    x = every.get(AXES[0])
    if x is None or not np.isfinite(x).all():
        return {}
    leaves_out = "imported" in trial.spec or (TRAINED_BY in trial.provenance and trial.status == "done")
    found = {}
    for name, y in every.items():
        known = ~np.isnan(y) if leaves_out else np.ones(len(y), bool)
        known[-1:] |= math.isnan(trial.metrics.get(name, 0.0))
        found[name] = Curve.of(x[known], y[known])
    return found
