"""The episodes of a trial's evaluation on a robot's task, run again step by step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

from evoclaims.cli.stored_trial import Stored
from evoclaims.core.keys import EVALUATION, TRAINING, trial_key
from evoclaims.envs.ecorobot.robot_task import RobotTask
from evoclaims.trials.devices import MATMUL_PRECISION


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
