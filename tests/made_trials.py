"""Trial records made by hand, sound ones, for every test that judges, stores or shows trials without an engine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from evoclaims.core.canonical import content_hash
from evoclaims.trials.result import Status, TrialResult, digest
from evoclaims.trials.spec import Condition, TrialSpec

Numbers = Mapping[str, tuple[float, ...]]


def sound(
    spec: Mapping[str, Any],
    *,
    status: Status = "done",
    metrics: Mapping[str, float],
    levels: Numbers,
    curves: Numbers,
    champion: bytes = b"",
    **changes: Any,
) -> TrialResult:
    """Return a record whose id, condition and digest follow from its parts; `changes` may make it unsound again."""
    made = TrialResult(
        id=content_hash(spec),
        condition=content_hash({name: value for name, value in spec.items() if name != "seed"}),
        spec=dict(spec),
        seed=spec["seed"],
        status=status,
        metrics=metrics,
        levels=levels,
        curves=curves,
        digest=digest(status, metrics, levels, curves, champion),
        timing={"run": 1.0, "compile": 0.5, "batch": 1, "started": "2025-01-01T00:00:00+00:00"},
        provenance={},
    )
    return replace(made, **changes)


def trial_of(
    condition: Condition,
    seed: int,
    value: float,
    status: Status = "done",
    *,
    metrics: Mapping[str, float] | None = None,
    curves: Numbers | None = None,
    **changes: Any,
) -> TrialResult:
    """Return a trial of a condition whose success is `value` on every level, and its fitness the same.

    Args:
        metrics: those that do not follow from `value`, or not as they do here; "last_fitness" is every level's.
    """
    metrics = {
        **dict.fromkeys(("mean_success", "last_success", "last_fitness"), value),
        **dict.fromkeys(("furthest_solved", "furthest_reached"), 1.0),
        "steps": 2.0,
        "environment_steps": 50.0,
        **(metrics or {}),
    }
    levels = {
        name: (number,) * condition.task.levels
        for name, number in (("success", value), ("fitness", metrics["last_fitness"]))
    }
    spec = TrialSpec(condition, seed).plain
    return sound(spec, status=status, metrics=metrics, levels=levels, curves=curves or {}, **changes)
