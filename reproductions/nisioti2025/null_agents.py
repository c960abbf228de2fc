"""What has learnt nothing, to which every assertion is put (`evoclaims audit`): one that it satisfies is vacuous."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from evoclaims import Condition, NullAgent
from evoclaims.envs import Circuit, DeceptiveMaze, Locomotion, Obstacles, Pose, SteppingStones
from evoclaims.methods import Neat
from reproductions.nisioti2025.measures import constant_success

Numbers = dict[str, dict[str, Any]]


def no_action(condition: Condition) -> Numbers | None:
    """Return what a robot has that stays where it starts; None where that is not known."""
    task = condition.task
    metrics: dict[str, float]
    if isinstance(task, SteppingStones | DeceptiveMaze):
        reward = _still(task)
        metrics = {"coverage": 1.0 / float(task.reachable().sum())}  # the cell in which it starts
        if isinstance(task, SteppingStones):
            metrics["stones"] = 0.0
        else:
            metrics["distance"] = math.dist(task.plan.start, task.plan.target) - task.plan.within
    elif isinstance(task, Locomotion | Obstacles):
        metrics = {"obstacles": 0.0, "furthest": 0.0}
        # Brax pays an ant 1 a step to be up
        reward = float(task.episode_steps) if task.robot.name == "ant" else 0.0
    else:
        return None
    idle = dict.fromkeys(("control_cost", "effort", "upside_down", "reached"), 0.0)
    return {
        "metrics": {**_nothing_solved(0.0), "last_fitness": reward, **idle, **metrics},
        "levels": {},
        "curves": {"coverage": (metrics.get("coverage", 0.0),), "reached": (0.0,), "fitness": (reward, reward)},
    }


@lru_cache
def _still(task: SteppingStones | DeceptiveMaze) -> float:
    """Return what the task's own rule pays in an episode for staying at the start: variants pay otherwise."""
    place = Pose(place=np.float32([*task.plan.start, 0.0]), rotation=np.eye(3, dtype=np.float32))

    def step(memory: Any, _: None) -> Any:
        ruling = task.rule(memory, place, place, jnp.zeros(0))
        return ruling.memory, (ruling.reward, ruling.ended)

    def first() -> Any:
        start = task.memory(place)
        return start, *step(start, None)

    start, after, (reward, over) = jax.jit(first)()
    if not over and jax.tree.all(jax.tree.map(np.array_equal, start, after)):  # so every step is the first one again
        return math.fsum([float(reward)] * task.episode_steps)
    _, (paid, ended) = jax.lax.scan(step, start, length=task.episode_steps)
    # The step that ends an episode is paid, too.
    return math.fsum(np.asarray(paid)[np.cumsum(ended) - ended == 0].tolist())


def constant_circuit(condition: Condition) -> Numbers | None:
    """Return what the best circuit has that gives one answer, whatever it is asked."""
    task = condition.task
    if not isinstance(task, Circuit):
        return None
    success = constant_success(task)
    metrics = {**_nothing_solved(success[-1]), "mean_success": math.fsum(success) / len(success)}
    return {"metrics": metrics, "levels": {"success": success}, "curves": {}}


def full_arrays(condition: Condition) -> Numbers | None:
    """Return the size of a network of NEAT's that fills the arrays of its genome."""
    if not isinstance(condition.method, Neat):
        return None
    settings = condition.method.settings
    sizes = {"champion_nodes": (float(settings.nodes),), "champion_connections": (float(settings.connections),)}
    return {"metrics": {}, "levels": {}, "curves": sizes}


def as_examined(task: Any) -> Any:
    """Return a task without what leaves the meaning of an agent's numbers as it is: sampled rows, and a goal shown."""
    if isinstance(task, Circuit):
        return replace(task, sampling="exhaustive")  # type: ignore[type-var]
    return replace(task, shows_goal=False) if isinstance(task, SteppingStones) else task


def _nothing_solved(success: float) -> dict[str, float]:
    """Return metrics of a trial that ends at its first level."""
    return {"last_success": success, "mean_success": success, "furthest_solved": -1.0, "furthest_reached": 0.0}


NULL_AGENTS = {
    "no action": NullAgent("a robot that takes no action", no_action),
    "constant circuit": NullAgent("the best circuit that always gives the same answer", constant_circuit),
    "random policy": NullAgent("a network with random weights", method="random_policy", meets=as_examined),
    "random search": NullAgent(
        "random search, with the evaluations of CMA-ES", method="random_search", meets=as_examined
    ),
    "full arrays": NullAgent("a network that fills the arrays of its genome", full_arrays, everywhere=True),
}
