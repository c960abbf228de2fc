"""No program spans devices: jax's partitioner has nothing to do, and cannot end the process."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import pytest
from trial_toys import Walker, walk

from evoclaims.methods.base import Progress
from evoclaims.trials.layout import Layout
from evoclaims.trials.runner import run
from evoclaims.trials.store import Store


@dataclass(frozen=True)
class EmptySumWalker(Walker):
    """A walker whose steps add the sum of no numbers.

    It is the smallest method that ended the process: since jax 0.11, a function under `shard_map` over two devices or
    more that closes over an array without elements is a segmentation fault in XLA's compilation. NEAT and HyperNEAT
    have such an array where their genomes need no second capacity.
    """

    name: ClassVar[str] = "empty_sum_walker"

    def step(self, key: jax.Array, task: Any, level: jax.Array, state: jax.Array) -> tuple[jax.Array, Progress]:
        nothing = jnp.sum(jnp.array([], bool), dtype=jnp.float32)
        return super().step(key, task, level, state + nothing)


@pytest.fixture(params=Layout)
def layout(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Any:
    """How trials are laid out, on a CPU and on accelerators."""
    monkeypatch.setattr("evoclaims.trials.lanes.layout_on", lambda platform: request.param)
    return request.param


def test_a_step_may_close_over_an_array_without_elements(layout: Layout, cpus: list[Any], tmp_path: Path) -> None:
    condition = replace(walk(chance=0.2), method=EmptySumWalker(chance=0.2))
    results = run(condition, range(3), Store(tmp_path), cpus)
    assert [result.status for result in results] == ["done"] * 3
