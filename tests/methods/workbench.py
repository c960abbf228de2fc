"""A method on a task, with its step compiled once for all tests."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from usual_fusions import USUAL_FUSIONS

from evoclaims.methods.base import Progress


class Workbench:
    """Runs a method's pure functions; a seed stands for all the keys of a run.

    `usual_step` is compiled as for users, to be compared with other programs; `step`, which most tests share, sooner.
    """

    def __init__(self, method: Any, task: Any) -> None:
        self.method, self.task, self.traces = method, task, 0
        self.step: Callable[[Any, Any, Any], tuple[Any, Progress]] = jax.jit(self._traced)
        self.usual_step = jax.jit(self._traced, compiler_options=USUAL_FUSIONS) if USUAL_FUSIONS else self.step
        self._init = jax.jit(lambda key: method.init(key, task))
        self._examine = jax.jit(lambda state, level: task.examine(method.best(task, state), jax.random.key(0), level))

    def _traced(self, key: Any, level: Any, state: Any) -> tuple[Any, Progress]:
        self.traces += 1
        return self.plain_step(key, level, state)

    def plain_step(self, key: Any, level: Any, state: Any) -> tuple[Any, Progress]:
        return self.method.step(key, self.task, level, state)

    def init(self, seed: int = 0) -> Any:
        return self._init(jax.random.key(seed))

    def run(
        self, steps: int, seed: int = 0, level: int = 0, state: Any = None, usual: bool = False
    ) -> tuple[Any, list[Progress]]:
        """Take `steps` steps, with the `usual_step` or the other; the i-th uses the key `seed + 1` folded with i."""
        one_step = self.usual_step if usual else self.step
        state = self.init(seed) if state is None else state
        reports = []
        for step in range(steps):
            key = jax.random.fold_in(jax.random.key(seed + 1), step)
            state, progress = one_step(key, jnp.asarray(level, jnp.int32), state)
            reports.append(progress)
        return state, reports

    def examine(self, state: Any, level: int = 0) -> Any:
        """Return the examination of the method's best policy."""
        return self._examine(state, jnp.asarray(level, jnp.int32))


def leaves(tree: Any) -> list[Any]:
    """Return the leaves as NumPy arrays, keys as their bits."""

    def plain(leaf: Any) -> Any:
        typed = isinstance(leaf, jax.Array) and jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key)
        return np.asarray(jax.random.key_data(leaf) if typed else leaf)

    return [plain(leaf) for leaf in jax.tree.leaves(tree)]


def same_bits(one: Any, other: Any) -> bool:
    """Whether two trees of the same structure hold the same bits."""
    return all(a.tobytes() == b.tobytes() for a, b in zip(leaves(one), leaves(other), strict=True))


def close(one: Any, other: Any, tolerance: float = 1e-5) -> None:
    """Assert that two trees of the same structure hold nearly the same numbers."""
    for a, b in zip(leaves(one), leaves(other), strict=True):
        np.testing.assert_allclose(a, b, rtol=tolerance, atol=tolerance)
