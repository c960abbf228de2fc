"""In which order claims are judged, and by which of several workers."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import Generic, TypeVar

from evoclaims.claims.workload import Workload

W = TypeVar("W", bound=Hashable)


class Order(Generic[W]):
    """Chooses the next claim for a worker.

    The first claim is the one with trials that is judged soonest, so that a verdict is there early. Then come those
    whose trials are there; then those with the longest condition, and nothing besides it if possible, so that the
    workers end together; or, for one worker alone, those that take the least. A worker that has begun with a condition
    keeps the claims on it, and on conditions that share its compiled programs, while others have anything else to do.
    """

    def __init__(self, load: Workload, workers: int) -> None:
        """Give out nothing yet."""
        self._needs = load.claims
        self._alone = workers < 2
        self._seconds = {name: work.seconds for name, work in load.conditions.items()}
        self._programs = {name: work.programs for name, work in load.conditions.items()}
        self._begun: dict[str, W] = {}
        self._ended: set[str] = set()
        self._first = True

    def knows(self, claim: str) -> bool:
        """Whether `claim` is the name of a claim test of this run."""
        return claim in self._needs

    def next(self, worker: W, claims: Sequence[str]) -> str:
        """Return which of the claims that nobody has yet (at least one) a worker is to judge next."""
        soonest = [claim for claim in claims if self._needs[claim]] if self._first else []
        if soonest:
            self._first = False
            claim = min(soonest, key=lambda one: self._new_seconds(self._needs[one]))
        else:
            claim = min(claims, key=lambda one: self._rank(worker, one))
        for condition in self._needs[claim]:
            self._begun.setdefault(condition, worker)
        return claim

    def ended(self, claim: str) -> None:
        """Note that a claim has been judged, so that the trials that it needs are there."""
        self._ended.update(self._needs[claim])

    def lost(self, worker: W) -> None:
        """Note that a worker has died: another one may run what it had begun."""
        self._begun = {name: one for name, one in self._begun.items() if one != worker or name in self._ended}

    def _rank(self, worker: W, claim: str) -> tuple[int, float, float]:
        """Return the place of a claim among those that a worker could judge next; the lowest comes first."""
        needs = self._needs[claim]
        new = self._new_seconds(needs)
        if any(self._begun.get(name, worker) != worker and name not in self._ended for name in needs):
            conflict = 2  # the worker would wait for another one's trials
        elif new and any(self._owner(name) not in (None, worker) for name in needs if name not in self._begun):
            conflict = 1  # another one has the programs
        else:
            conflict = 0
        longest = max((self._seconds[name] for name in needs if name not in self._begun), default=0.0)
        return conflict, 0.0 if self._alone or not new else 1 / longest, new

    def _new_seconds(self, needs: Sequence[str]) -> float:
        """Return the seconds of what nobody has begun with."""
        return sum(self._seconds[name] for name in needs if name not in self._begun)

    def _owner(self, condition: str) -> W | None:
        """Return the worker that was the first to begin with a condition of the same programs."""
        programs = self._programs[condition]
        return next((one for name, one in self._begun.items() if self._programs[name] == programs), None)
