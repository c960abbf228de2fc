"""Does a small instance of the obstacles show what the paper says of them?

    python benchmarks/small_obstacles.py STORE [INSTANCE ...]

Trains ten trials of four methods on each instance, with seeds that no claim judges. It prints medians and quartiles of
reward, obstacles passed, furthest x (m) and share of steps upside-down, CPU seconds, and A12: how often a trial of one
method collects more than one of another. A smoke claim needs an A12 of about 0.9 for a power of 0.95 with ten trials.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Final

from evoclaims.trials import devices

devices.configure()

import jax  # noqa: E402
import numpy as np  # noqa: E402

from evoclaims import Budget, Condition  # noqa: E402
from evoclaims.envs import Obstacles  # noqa: E402
from evoclaims.judging.effect import a12  # noqa: E402
from evoclaims.trials.runner import run  # noqa: E402
from evoclaims.trials.store import Store  # noqa: E402
from reproductions.nisioti2025.ecorobot import SMOKE  # noqa: E402

SEEDS: Final = range(5_000, 5_010)
METHODS: Final = ("neat", "hyperneat", "cma_es", "ppo")
PAIRS: Final = (("neat", "hyperneat"), ("neat", "cma_es"), ("ppo", "hyperneat"), ("ppo", "cma_es"), ("neat", "ppo"))
NUMBERS: Final = ("last_fitness", "obstacles", "furthest", "upside_down")


@dataclass(frozen=True)
class NearObstacles(Obstacles):
    """Six obstacles near the start: of 5 to 30 cm, or all of 30 cm.

    Attributes:
        apart: distance from one to the next, m.
    """

    name: ClassVar[str] = "near_obstacles"
    revision: ClassVar[int] = 1

    apart: float = 1.0

    @property
    def obstacle_places(self) -> tuple[float, ...]:
        """From x = 2 m on."""
        return tuple(2.0 + self.apart * at for at in range(6))

    @property
    def tops(self) -> tuple[float, ...]:
        """Height of each obstacle, m."""
        return (0.05, 0.1, 0.15, 0.2, 0.25, 0.3) if self.heights == "hierarchical" else (0.3,) * 6


INSTANCES: Final = {
    "near": (NearObstacles(episode_steps=100), 250_000),
    "brief": (NearObstacles(episode_steps=100), 100_000),
    "high": (NearObstacles(episode_steps=100, heights="high"), 250_000),
    "far": (NearObstacles(episode_steps=200, apart=1.5), 1_000_000),
}
"""Tasks, and environment steps of a trial."""


def main(store: Store, names: list[str]) -> None:
    """Run the instances of these names; all without any."""
    for name in names or list(INSTANCES):
        task, steps = INSTANCES[name]
        rewards = {}
        for method in METHODS:
            known = SMOKE[method, "obstacles"].method
            budget = Budget(environment_steps=steps, reports=10)
            if method != "ppo":
                budget = Budget(generations=steps // known.cost(task), reports=10)
            began = time.process_time()
            trials = run(Condition(known, task, "whole_budget", budget), SEEDS, store, jax.local_devices())
            seconds = time.process_time() - began
            rewards[method] = [trial.metrics["last_fitness"] for trial in trials]
            shown = (f"{one} {_quartiles([trial.metrics[one] for trial in trials])}" for one in NUMBERS)
            print(f"{name} {method}: {', '.join(shown)}; {seconds:.0f} CPU seconds", flush=True)
        print(f"{name}:", *(f"{a} > {b}: {a12(rewards[a], rewards[b]):.2f}" for a, b in PAIRS), sep="  ", flush=True)


def _quartiles(values: list[float]) -> str:
    low, middle, high = np.percentile(values, [25, 50, 75])
    return f"{middle:.2f} ({low:.2f} to {high:.2f})"


if __name__ == "__main__":
    main(Store(Path(sys.argv[1])), sys.argv[2:])
