"""Making the record of an ended trial."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from types import MappingProxyType
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

from evoclaims.core.packages import DEPENDS_ON, without_flags
from evoclaims.core.provenance import collect, device_of
from evoclaims.core.source_code import CODE
from evoclaims.methods.base import Method, PartlyUsed
from evoclaims.trials.arrays import pack
from evoclaims.trials.devices import MATMUL_PRECISION
from evoclaims.trials.program import NEVER, Report, Score
from evoclaims.trials.result import Status, TrialResult, check_success, digest
from evoclaims.trials.spec import Condition, TrialSpec


def curve_point(spec_cost: int, report: Report, lane: int) -> dict[str, float]:
    """Return one point of a lane's training curve; `spec_cost` is the number of environment steps per step."""
    steps = int(report.steps[lane])
    return {
        "steps": steps,
        "environment_steps": steps * spec_cost,
        "level": int(report.level[lane]),
        "fitness": float(report.fitness[lane]),
        "success": float(report.success[lane]),
        **{name: float(values[lane]) for name, values in report.metrics.items()},
    }


def make_result(
    spec: TrialSpec,
    report: Report,
    score: Score,
    lane: int,
    curves: Mapping[str, Sequence[float]],
    timing: Mapping[str, Any],
    devices: Sequence[jax.Device],
) -> tuple[TrialResult, dict[str, NDArray[Any]]]:
    """Return the record of the trial in `lane`, and its champion's parameters by name.

    Metrics of every task with levels:
        mean_success, last_success: of the final policy, over all levels and on the last.
        last_fitness: of the final policy on the last level.
        furthest_solved: highest level solved in training, -1 for none.
        furthest_reached: highest level trained on.
        steps, environment_steps: spent until the trial ended.
    The task's own metrics of the final policy on the last level are added. Even if its last step was healthy, a trial
    has diverged when its final policy uses parameters or gets scores that are not finite.
    """
    cost = spec.condition.cost
    success, fitness = np.asarray(score.final.success)[lane], np.asarray(score.final.fitness)[lane]
    check_success(f"The examination of {spec.condition.label}", *map(float, success))
    solved_at = np.asarray(score.solved_at)[lane]
    solved = np.flatnonzero(solved_at != NEVER)
    steps = int(report.steps[lane])
    metrics = {
        "mean_success": float(np.mean(success, dtype=np.float64)),
        "last_success": float(success[-1]),
        "last_fitness": float(fitness[-1]),
        "furthest_solved": float(solved[-1]) if len(solved) else -1.0,
        "furthest_reached": float(report.level[lane]),
        "steps": float(steps),
        "environment_steps": float(steps * cost),
        **{name: float(np.asarray(values)[lane, -1]) for name, values in score.final.metrics.items()},
    }
    levels = {
        "success": tuple(map(float, success)),
        "fitness": tuple(map(float, fitness)),
        "solved_at": tuple(float(int(x) * cost) if x != NEVER else float(NEVER) for x in solved_at),
    }
    parameters = jax.tree.map(lambda leaf: np.asarray(leaf)[lane], score.parameters)
    champion = named_leaves(parameters)
    healthy = not report.diverged[lane] and is_sound(spec.condition.method, parameters) and are_finite(success, fitness)
    status: Status = "done" if healthy else "diverged"
    return make_record(spec, status, metrics, levels, curves, pack(champion), timing, devices), champion


def make_unfinished(
    spec: TrialSpec,
    status: Status,
    curves: Mapping[str, Sequence[float]],
    timing: Mapping[str, Any],
    devices: Sequence[jax.Device],
    reason: str = "",
) -> TrialResult:
    """Return the record of a timed-out or crashed trial: its curves so far, and metrics from them; no champion.

    Its `reason`, if there is one, is part of its digest, and is kept in the provenance as "crash".

    Metrics are "steps", "environment_steps" and "furthest_reached", at the curve's last point.
    """
    last = {name: float(values[-1]) for name, values in curves.items() if values}
    metrics = {"steps": last.get("steps", 0.0), "environment_steps": last.get("environment_steps", 0.0)}
    if "level" in last:
        metrics["furthest_reached"] = last["level"]
    notes = {"crash": reason} if reason else {}
    return make_record(spec, status, metrics, {}, curves, reason.encode(), timing, devices, notes)


def make_record(
    spec: TrialSpec,
    status: Status,
    metrics: Mapping[str, float],
    levels: Mapping[str, tuple[float, ...]],
    curves: Mapping[str, Sequence[float]],
    champion: bytes,
    timing: Mapping[str, Any],
    devices: Sequence[jax.Device],
    origin: Mapping[str, Any] = MappingProxyType({}),
) -> TrialResult:
    """Return the record; `champion` is its packed parameters, and `origin` goes into its provenance, too."""
    plain_curves = {name: tuple(map(float, values)) for name, values in curves.items()}
    return TrialResult(
        id=spec.id,
        condition=spec.condition.id,
        spec=spec.plain,
        seed=spec.seed,
        status=status,
        metrics=metrics,
        levels=levels,
        curves=plain_curves,
        digest=digest(status, metrics, levels, plain_curves, champion),
        timing={**timing, "ended": datetime.now(UTC).isoformat(timespec="seconds")},
        provenance={**provenance(devices, spec.condition), **origin},
    )


def is_sound(method: Method[Any], parameters: Any) -> bool:
    """Whether all parameters that a policy of `method` uses are finite; `parameters` are on the host."""
    return are_finite(*jax.tree.leaves(method.used(parameters) if isinstance(method, PartlyUsed) else parameters))


def are_finite(*arrays: NDArray[Any]) -> bool:
    """Whether no array contains NaN or infinity."""
    return all(bool(np.all(np.isfinite(array))) for array in arrays)


def provenance(devices: Sequence[jax.Device], condition: Condition) -> dict[str, Any]:
    """Return the process's provenance, with the devices, precision and packages that trials use."""
    found = collect()
    return {
        **found,
        "versions": {**found["versions"], **without_flags(condition.versions)},
        DEPENDS_ON: list(condition.packages),
        **({CODE: dict(condition.code)} if condition.code else {}),
        "device": device_of(devices),
        "matmul_precision": MATMUL_PRECISION,
    }


def named_leaves(tree: Any) -> dict[str, Any]:
    """Return the leaves of a tree by their paths, such as "[0].mean", in their order."""
    leaves, _ = jax.tree_util.tree_flatten_with_path(tree)
    return {jax.tree_util.keystr(path) or "parameters": leaf for path, leaf in leaves}
