"""A stored trial as commands use it: its record, its champion, and the episodes of its evaluation on a robot's task."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jax
import numpy as np
from numpy.typing import NDArray

from evoclaims.cli.project import Project
from evoclaims.core.errors import UserError
from evoclaims.core.keys import EVALUATION, TRAINING, trial_key
from evoclaims.core.printable import printable
from evoclaims.paper import references
from evoclaims.paper.cost import Estimator, Wanted
from evoclaims.report.live_line import duration
from evoclaims.trials import champion_replay, devices
from evoclaims.trials.devices import MATMUL_PRECISION
from evoclaims.trials.failed import time_allowed, why
from evoclaims.trials.imported import where_from
from evoclaims.trials.result import COMPLETE, TrialResult
from evoclaims.trials.spec import Condition, TrialSpec

if TYPE_CHECKING:
    from evoclaims.envs.ecorobot.robot_task import RobotTask  # which imports MuJoCo


@dataclass(frozen=True)
class Stored:
    """A trial out of the store: its record, its champion's parameters (see `champion_replay.load`), and both places."""

    title: str
    condition: Condition
    result: TrialResult
    parameters: Any
    file: Path


def load(project: Project, tier: str, method: str, task: str, seed: int) -> Stored:
    """Return a stored trial with its champion: this environment's, or else the newest of other versions.

    A trial that is not stored is read from the reference trials, if its champion is committed there.

    Raises:
        UserError: for unknown names, a trial that is not stored (with the command that runs it and what that takes),
            and as `champion_replay.load` does.
    """
    reproduction, store = project.reproduction, project.store
    condition, title = reproduction.tier(tier).condition(method, task), f"{method} on {task} ({tier})"
    if condition.existing:
        raise UserError(f"{title} has no champion: its {where_from(condition)}.")
    spec = TrialSpec(condition, seed)
    result = store.get(spec.id, condition.versions)
    if result is None:
        for trial in references.of_condition(reproduction.references, tier, method, task, condition.id):
            arrays = references.champion_of(reproduction.references, tier, trial) if trial.seed == seed else None
            if arrays is not None:
                file = references.champion_path(reproduction.references, tier, trial)
                return Stored(title, condition, trial, champion_replay.unpacked(arrays, condition, trial), file)
        estimator = Estimator(store, reproduction, tier, devices.choose("auto")[0].platform)
        cost = estimator.owed({"": Wanted((method, task), condition, [seed])})[""].cost
        takes = "" if cost.basis == "budget" else f", in about {duration(cost.seconds())}"
        raise UserError(
            f"{store.root} holds no trial of {title} with seed {seed}, and no champion of it is committed. "
            f"`evoclaims run {method} --on {task} --tier {tier} --trials 1 --first-seed {seed}{store.option}` runs "
            f"it{takes}."
        )
    return Stored(title, condition, result, champion_replay.load(store, condition, result), store.champion_file(result))


def describe(result: TrialResult) -> str:
    """Return a trial in one line."""
    steps = result.metrics.get("environment_steps")
    after = "" if steps is None else f" after {int(steps):,} environment steps"
    spent = f"seed {result.seed}: {result.status}{after}"
    took = f"({duration(result.timing['run'])} for the batch of {result.timing['batch']})"
    if result.status == "timeout":
        limit = duration(time_allowed(result))
        return f"{spent}: its batch had {limit}; more by --time-limit, as much again by --retry {took}"
    if result.status not in COMPLETE:
        reason = why(result)
        return f"{spent}{': ' * bool(reason)}{printable(reason)} {took}"
    success = " ".join(f"{value:.3f}" for value in result.levels["success"])
    return f"{spent}, success by level {success} {took}"


@dataclass(frozen=True)
class Outings:
    """The episodes of a trial's evaluation, up to where each ended.

    Attributes:
        positions: generalized positions of each episode, shapes [steps, nq].
        torsos: the torso's centre in each, shapes [steps, 3], m.
        reached: whether each reached the task's goal.
    """

    positions: Sequence[NDArray[np.float32]]
    torsos: Sequence[NDArray[np.float32]]
    reached: Sequence[bool]


def run_again(trial: Stored, task: RobotTask, device: jax.Device) -> Outings:
    """Run the episodes of a trial's evaluation again, from the same starts (see `RobotTask.examine`)."""
    method, judged = trial.condition.method, trial.condition.task

    def episodes(parameters: Any) -> tuple[Any, Any, Any, Any]:
        untrained = method.best(judged, method.init(trial_key(0, TRAINING), judged))
        policy = replace(untrained, parameters=parameters)
        (level_key,) = jax.random.split(trial_key(trial.result.seed, EVALUATION), task.levels)
        keys = jax.random.split(level_key, task.examined_episodes)
        outing, alive = jax.vmap(lambda key: task.trajectory(policy, key))(keys)
        return outing.body.position, outing.pose.place, jax.vmap(jax.vmap(task.reached))(outing), alive

    with jax.default_matmul_precision(MATMUL_PRECISION):
        positions, torsos, reached, alive = jax.device_get(jax.jit(episodes)(jax.device_put(trial.parameters, device)))
    return Outings(
        positions=[steps[mask] for steps, mask in zip(positions, alive, strict=True)],
        torsos=[steps[mask] for steps, mask in zip(torsos, alive, strict=True)],
        reached=[bool(steps[mask][-1]) for steps, mask in zip(reached, alive, strict=True)],
    )
