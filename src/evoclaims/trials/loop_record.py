"""The record of a training loop's trial that has come to its end."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

import jax

from evoclaims.core.canonical import content_hash
from evoclaims.methods.training_loop import TrainingLoop
from evoclaims.trials.loop_messages import Trained
from evoclaims.trials.result import RETURNED, TRAINED_BY, Status, TrialResult
from evoclaims.trials.result_making import make_record
from evoclaims.trials.spec import TrialSpec

SCORED_BY: Final = "scored_by"
"""Key of a provenance that says who has scored the final policy: "examination", or the "training function" itself."""


def trained_record(
    spec: TrialSpec,
    trained: Trained,
    curves: Mapping[str, Sequence[float]],
    timing: Mapping[str, Any],
    devices: Sequence[jax.Device],
) -> TrialResult:
    """Return the record of a trial whose function has returned.

    The metrics are those of the function, those of every method (see `result_making.make_result`) and the task's own.
    The examination's numbers count, not the function's. Without one, those that the function does not return
    are NaN: a claim that reads such a number is an error. A trial has diverged when its function returned a NaN, or
    reported a number that is not finite, or its policy's scores are not.
    """
    assert isinstance(spec.condition.method, TrainingLoop)
    returned, scores = trained.metrics, trained.scores
    broken = not trained.finite or any(map(math.isnan, returned.values()))
    if scores is None:  # the last level at most is known
        unknown = (math.nan,) * (spec.condition.task.levels - 1)
        levels = {name: (*unknown, returned.get(f"last_{name}", math.nan)) for name in ("success", "fitness")}
    else:
        levels = {"success": scores.success, "fitness": scores.fitness}
        broken = broken or not all(map(math.isfinite, (*scores.success, *scores.fitness)))
    steps = returned.get("environment_steps", spec.condition.steps if trained.step is None else trained.step)
    success = levels["success"]
    solved = [level for level, value in enumerate(success) if value == 1.0]
    metrics = {
        "mean_success": math.fsum(success) / len(success),
        "last_success": success[-1],
        "last_fitness": levels["fitness"][-1],
        "furthest_solved": math.nan if math.isnan(success[-1]) else float(max(solved, default=-1)),
        "furthest_reached": math.nan,
        "steps": float(returned.get("steps", steps)),
        "environment_steps": float(steps),
    }
    if scores is None:
        metrics |= returned
    else:
        known = {name: value for name, value in metrics.items() if not math.isnan(value)}
        metrics |= returned | known | scores.metrics
    status: Status = "diverged" if broken else "done"
    origin = {
        TRAINED_BY: spec.condition.method.place,
        SCORED_BY: "training function" if scores is None else "examination",
        RETURNED: {
            "metrics": content_hash(dict(returned)),
            "actions": trained.actions,
            "graded": trained.graded,
        },
    }
    return make_record(spec, status, metrics, levels, curves, b"", timing, devices, origin)
