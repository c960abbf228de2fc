"""Trials for a report: each is read once, and only what is shown is kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from evoclaims.core.errors import UserError
from evoclaims.core.packages import Versions
from evoclaims.paper.archive import Archive
from evoclaims.report.origin import Origin
from evoclaims.trials.result import TrialResult

POINTS: Final = 100
"""Most points of a training curve that are kept."""


@dataclass(frozen=True, eq=False)
class TrialSummary:
    """One trial.

    Attributes:
        trial: its id.
        seed, status, champion: as in its record.
        score: the "mean_success" metric; None without it.
        origin: where it was made.
        reports: how many points its curves have.
        curves: by name, at most `POINTS` evenly spread points of each, the first and the last among them.
    """

    trial: str
    seed: int
    status: str
    champion: str
    score: float | None
    origin: Origin
    reports: int
    curves: Mapping[str, NDArray[np.float64]]


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
        """Return a trial."""
        if trial not in self._read:
            try:
                found = self._archive.get(trial, versions)
            except UserError as error:
                self.troubles[str(error)] = None
                found = None
            self._read[trial] = None if found is None else self._summary(found)
        return self._read[trial]

    def _summary(self, found: TrialResult) -> TrialSummary:
        """Keep what is shown of a record."""
        self.settings.setdefault(found.condition, {k: v for k, v in found.spec.items() if k != "seed"})
        origin = Origin.of(found.provenance)
        reports = max(map(len, found.curves.values()), default=0)
        kept = slice(None) if reports <= POINTS else np.linspace(0, reports - 1, POINTS).round().astype(int)
        return TrialSummary(
            trial=found.id,
            seed=found.seed,
            status=found.status,
            champion=found.champion,
            score=found.metrics.get("mean_success"),
            origin=self._origins.setdefault(origin, origin),
            reports=reports,
            curves={name: np.asarray(curve, np.float64)[kept] for name, curve in found.curves.items()},
        )
