"""What do the full tier's policies among obstacles collect, under other readings of reward, episode and obstacles?

    python benchmarks/obstacle_readings.py STORE [STORE ...]

Runs the examination of every stored trial with a champion again, for 2,000 steps, on obstacles of other shapes and
surfaces, and prints means over trials: the reward after 1,000 steps with the control cost (what the claims judge),
then without it after 1,000 and 2,000 steps, and how many of the fifteen obstacles were passed.

A reward without control cost is the distance in m divided by 0.05 s: beyond the last obstacle are more than 1,024.
Policies are not trained anew: a reading that changes what is learned shows only part of its effect here.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from evoclaims.trials import devices

devices.configure()

import jax  # noqa: E402
import numpy as np  # noqa: E402

from evoclaims.core.keys import EVALUATION, TRAINING, trial_key  # noqa: E402
from evoclaims.envs import Box, Obstacles, Surface  # noqa: E402
from evoclaims.envs.ecorobot.locomotion import HALF_THICKNESS, PLACES  # noqa: E402
from evoclaims.trials import champions  # noqa: E402
from evoclaims.trials.devices import MATMUL_PRECISION  # noqa: E402
from evoclaims.trials.result import TrialResult  # noqa: E402
from evoclaims.trials.spec import Condition, TrialSpec  # noqa: E402
from evoclaims.trials.store import Store  # noqa: E402
from reproductions.nisioti2025.ecorobot import FULL, HIERARCHICAL  # noqa: E402
from reproductions.nisioti2025.published_course import SURFACE, PublishedObstacles, published_boxes  # noqa: E402

SHORT, LONG = 1_000, 2_000


@dataclass(frozen=True)
class PartlyPublished(Obstacles):
    """Obstacles that have some of what the published ones have: the depth, if `flat`, or a part of the surface."""

    flat: bool = False
    surface: Surface = Surface()

    @property
    def boxes(self) -> tuple[Box, ...]:
        """The obstacles."""
        return published_boxes(super().boxes, flat=self.flat, surface=self.surface)


COURSES = {
    "ours": Obstacles(episode_steps=LONG),
    "flat": PartlyPublished(episode_steps=LONG, flat=True),
    "rough": PartlyPublished(episode_steps=LONG, surface=Surface(friction=SURFACE.friction)),
    "hard": PartlyPublished(episode_steps=LONG, surface=replace(SURFACE, friction=Surface().friction)),
    "all three, as published": PublishedObstacles(episode_steps=LONG),
}


def stored(condition: Condition, stores: Sequence[Store]) -> Iterator[tuple[TrialResult, Any]]:
    """Yield the trials of a condition, seeds 0 to 9, with their champions, each from the first store that has it."""
    for seed in range(10):
        for store in stores:
            kept = [record for record in store.records(TrialSpec(condition, seed).id) if store.has_champion(record)]
            if kept:
                yield kept[0], champions.load(store, condition, kept[0])
                break


def outings(condition: Condition, trials: Sequence[tuple[TrialResult, Any]], course: Obstacles) -> tuple[Any, Any, Any]:
    """Return x and the furthest x (m), and the sum of squared actions, after each step, [trials, episodes, steps]."""
    method, task = condition.method, condition.task
    untrained = method.best(task, method.init(trial_key(0, TRAINING), task))

    def examined(seed: Any, parameters: Any) -> Any:
        policy = replace(untrained, parameters=parameters)
        (level_key,) = jax.random.split(trial_key(seed, EVALUATION), task.levels)
        keys = jax.random.split(level_key, course.examined_episodes)
        outing, _ = jax.vmap(lambda key: course.trajectory(policy, key))(keys)
        return outing.pose.place[..., 0], outing.memory.furthest, outing.effort

    seeds = np.array([result.seed for result, _ in trials], np.int32)
    parameters = jax.tree.map(lambda *leaves: np.stack(leaves), *(champion for _, champion in trials))
    with jax.default_matmul_precision(MATMUL_PRECISION):
        made: tuple[Any, Any, Any] = jax.device_get(jax.jit(jax.vmap(examined))(seeds, parameters))
    return made


def main() -> None:
    """Print a line for each method and course."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stores", nargs="+", type=Path, metavar="STORE")
    stores = [Store(path) for path in parser.parse_args().stores]
    print(
        f"{'method':10} {'trials':>6} {'obstacles':24} {'paid':>6} {'free':>6} {'2,000':>6} {'passed':>6} {'2,000':>6}"
    )
    for (name, on), condition in FULL.items():
        trials = list(stored(condition, stores)) if on == HIERARCHICAL else []
        for says, course in COURSES.items() if trials else ():
            x, furthest, effort = outings(condition, trials, course)
            free = x / course.scene.seconds
            paid = free - Obstacles().robot.control_cost * effort
            passed = (furthest[..., None] > np.array(PLACES) + HALF_THICKNESS).sum(axis=-1)
            numbers = [paid[..., SHORT - 1], *(free[..., steps - 1] for steps in (SHORT, LONG))]
            numbers += [passed[..., steps - 1] for steps in (SHORT, LONG)]
            means = " ".join(f"{mean.mean():6.0f}" for mean in numbers[:3])
            print(f"{name:10} {len(trials):6} {says:24} {means} " + " ".join(f"{n.mean():6.1f}" for n in numbers[3:]))


if __name__ == "__main__":
    main()
