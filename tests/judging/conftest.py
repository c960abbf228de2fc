"""Stored trials without an engine: each source serves records that the test wrote down."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import pytest
from made_trials import sound

from evoclaims.judging.measure import Event, Measure, Profile
from evoclaims.trials.result import TrialResult

Value = float | str | tuple[float, ...]


def make_trial(
    seed: int, value: Value, condition: str = "condition", digest: str = "d", **provenance: Any
) -> TrialResult:
    """Return a record whose score is `value`; a string is a status, a tuple the success of each level."""
    return sound(
        {"condition": condition, "seed": seed},
        status=value if isinstance(value, str) else "done",  # type: ignore[arg-type]
        metrics={"score": value} if isinstance(value, int | float) else {},
        levels={"success": value} if isinstance(value, tuple) else {},
        curves={},
        id=f"{condition}-{seed}",
        condition=condition,
        digest=digest,
        provenance=provenance,
    )


@dataclass
class StoredSource:
    """A source over written-down trials; remembers what it was asked for."""

    label: str
    trials: dict[int, TrialResult]
    backwards: bool = False
    deterministic: bool = False
    existing: float = float("inf")
    table_rows: frozenset[tuple[str, int]] = frozenset()
    asked: list[tuple[int, ...]] = field(default_factory=list)

    @property
    def fingerprint(self) -> str:
        return f"id of {self.label}"

    def fetch(self, seeds: Sequence[int]) -> Sequence[TrialResult]:
        self.asked.append(tuple(seeds))
        found = [self.trials[seed] for seed in seeds]
        return found[::-1] if self.backwards else found

    def score(self, better: Any = "higher") -> Measure:
        return Measure(self, "score", lambda trial: trial.metrics["score"], better)

    def solved(self) -> Event:
        return Event(self, "solved", lambda trial: trial.metrics["score"] >= 1.0)

    def success(self, size: int) -> Profile:
        return Profile(self, "success", lambda trial: trial.levels["success"], size)


@pytest.fixture
def trial() -> Callable[..., TrialResult]:
    """Return the factory of trial records."""
    return make_trial


@pytest.fixture
def source() -> Callable[..., StoredSource]:
    """Return the factory of sources: `source("cma_es", [1.0, "diverged", ...])`, seeds counted from 0."""

    def make(label: str, values: Sequence[Value], backwards: bool = False) -> StoredSource:
        return StoredSource(label, {seed: make_trial(seed, v, label) for seed, v in enumerate(values)}, backwards)

    return make
