"""Does a small instance of the obstacles show what the paper says of them?

    python benchmarks/small_obstacles.py STORE [INSTANCE ...]

Trains ten trials of four methods on each instance, with seeds that no claim judges, and prints medians and quartiles of
the reward and of the obstacles passed, seconds, and how often a trial of one method collects more than one of another
(A12). A smoke claim needs an A12 of about 0.9 in each of its comparisons for a power of 0.95 with ten trials a side.
"""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, Final

from evoclaims.trials import devices

devices.configure()

import jax  # noqa: E402
import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402

from evoclaims import Budget, Condition  # noqa: E402
from evoclaims.envs import HALF_CHEETAH, Obstacles, Robot  # noqa: E402
from evoclaims.envs.base import TaskState  # noqa: E402
from evoclaims.judging.effect import a12  # noqa: E402
from evoclaims.trials.runner import run  # noqa: E402
from evoclaims.trials.store import Store  # noqa: E402
from reproductions.nisioti2025.ecorobot import SMOKE  # noqa: E402

SEEDS: Final = range(5_000, 5_010)
"""Neither judged nor a pilot's."""
STEPS: Final = 200
"""Of an episode, 10 s."""
METHODS: Final = ("neat", "hyperneat", "cma_es", "ppo")
PAIRS: Final = (("neat", "hyperneat"), ("neat", "cma_es"), ("ppo", "hyperneat"), ("ppo", "cma_es"), ("neat", "ppo"))


@dataclass(frozen=True)
class NearObstacles(Obstacles):
    """Six obstacles of rising height near the start.

    Attributes:
        push: velocity along x with which robots start, m/s.
        gait: amplitude of a fixed gait, to which actions are added; 0 for none.
        tallest: height of the last obstacle, m.
    """

    name: ClassVar[str] = "near_obstacles"
    revision: ClassVar[int] = 1

    episode_steps: int = STEPS
    push: float = 0.0
    gait: float = 0.0
    tallest: float = 0.3

    @property
    def obstacle_places(self) -> tuple[float, ...]:
        """Every 1.5 m."""
        return (2.0, 3.5, 5.0, 6.5, 8.0, 9.5)

    @property
    def tops(self) -> tuple[float, ...]:
        """From a sixth of the tallest."""
        return tuple(self.tallest * (at + 1) / 6 for at in range(6))

    def reset(self, key: Any, level: Any) -> TaskState:
        """Push the robot."""
        state = super().reset(key, level)
        body = state.inner.body
        pushed = replace(body, velocity=body.velocity.at[0].add(self.push))
        return replace(state, inner=replace(state.inner, body=pushed))

    def step(self, state: TaskState, action: Any) -> TaskState:
        """Add a gait: sinusoids of one frequency, a phase for each motor."""
        if not self.gait:
            return super().step(state, action)
        seconds = state.inner.time.astype(jnp.float32) * self.scene.seconds
        waves = jnp.asarray(GAIT[:6]) * jnp.sin(2 * jnp.pi * GAIT[12] * seconds + jnp.asarray(GAIT[6:12]))
        return super().step(state, jnp.clip(action + self.gait * waves, -1.0, 1.0))


GAIT: list[float] = []
"""Amplitudes, phases and the frequency (1/s) of the gait, found by `find_gait`."""


def find_gait() -> list[float]:
    """Return the best of some thousand random gaits on plain ground, by distance."""
    plain = NearObstacles(tallest=0.0006, gait=1.0)
    random = np.random.default_rng(0)
    tried = np.concatenate(
        [random.uniform(0, 1, (2_048, 6)), random.uniform(0, 2 * np.pi, (2_048, 6)), random.uniform(0.8, 4, (2_048, 1))],
        axis=1,
    ).astype(np.float32)

    @jax.jit
    def run_one(gait: Any, key: Any) -> Any:
        def step(state: TaskState, _: None) -> tuple[TaskState, None]:
            seconds = state.inner.time.astype(jnp.float32) * plain.scene.seconds
            waves = gait[:6] * jnp.sin(2 * jnp.pi * gait[12] * seconds + gait[6:12])
            return Obstacles.step(plain, state, waves), None

        state = plain.reset(key, jnp.int32(0))
        end, _ = jax.lax.scan(step, state, None, length=STEPS)
        return end.inner.pose.place[0] - 10.0 * end.inner.overturned / STEPS

    keys = jax.random.split(jax.random.key(1), 4)
    came = jax.vmap(lambda gait: jax.vmap(lambda key: run_one(gait, key))(keys).mean())(tried)
    best = int(np.argmax(came))
    print(f"the gait comes {came[best]:.1f} m in {STEPS} steps", flush=True)
    return [float(number) for number in tried[best]]


@cache
def light_cheetah() -> Robot:
    """Return the half-cheetah under a third of the earth's gravity."""
    folder = Path(tempfile.mkdtemp())
    (folder / "light_bodies").mkdir()
    (folder / "light_bodies" / "__init__.py").touch()
    text = Path(HALF_CHEETAH.file).read_text()
    assert 'gravity="0 0 -9.81"' in text, text[:1500]
    light = text.replace('gravity="0 0 -9.81"', 'gravity="0 0 -3.27"').replace(' iterations="4"', "")
    (folder / "light_bodies" / "light.xml").write_text(light)
    sys.path.insert(0, str(folder))
    return replace(HALF_CHEETAH, name="light_cheetah", xml="light_bodies:light.xml")


def instances() -> dict[str, tuple[Any, int]]:
    """Return tasks (made when asked for) and environment steps of a trial, by name."""
    return {
        "short": (lambda: NearObstacles(), 1_000_000),
        "long": (lambda: NearObstacles(), 4_000_000),
        "push": (lambda: NearObstacles(push=3.0), 1_000_000),
        "light": (lambda: NearObstacles(robot=light_cheetah()), 1_000_000),
        "low": (lambda: NearObstacles(tallest=0.12), 1_000_000),
        "gait": (lambda: NearObstacles(gait=1.0), 1_000_000),
    }


def main(store: Store, names: list[str]) -> None:
    """Run the instances of these names."""
    for name in names or list(instances()):
        make, steps = instances()[name]
        if name == "gait":
            GAIT[:] = find_gait()
        task, found = make(), {}
        for method in METHODS:
            known = SMOKE[method, "obstacles"]
            cost = known.method.cost(task)
            budget = Budget(generations=max(steps // cost, 1), reports=10) if method != "ppo" else Budget(environment_steps=steps, reports=10)
            began = time.process_time()
            trials = run(Condition(known.method, task, "whole_budget", budget), SEEDS, store, jax.local_devices())
            spent = time.process_time() - began
            rewards = found[method] = [trial.metrics["last_fitness"] for trial in trials]
            passed = [trial.metrics["obstacles"] for trial in trials]
            print(
                f"{name:6} {method:10} reward {_quartiles(rewards)}  passed {_quartiles(passed)}  "
                f"CPU {spent:.0f} s, of it {trials[0].timing['compile']:.0f} s wall to compile",
                flush=True,
            )
        print(name, *(f"{a} > {b}: {a12(found[a], found[b]):.2f}" for a, b in PAIRS), sep="  ", flush=True)


def _quartiles(values: list[float]) -> str:
    low, middle, high = np.percentile(values, [25, 50, 75])
    return f"{middle:.1f} ({low:.1f} to {high:.1f})"


if __name__ == "__main__":
    main(Store(Path(sys.argv[1])), sys.argv[2:])
