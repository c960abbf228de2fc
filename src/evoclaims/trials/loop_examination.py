"""The examination of a policy that a training loop returns, in the process that trained it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int
from numpy.typing import NDArray

from evoclaims.core.keys import EVALUATION, trial_key
from evoclaims.envs.base import Episode, Task
from evoclaims.kernels import kernel_prng
from evoclaims.trials.devices import MATMUL_PRECISION
from evoclaims.trials.jax_options import refuse_changed
from evoclaims.trials.loop_messages import Scores
from evoclaims.trials.program import examine_every_level

LOOKS: Final = 8
"""Least observations of a kind at which a policy is called on the host as well."""


def examined(task: Task, policy: Callable[[Any], Any], seed: int) -> Scores:
    """Return the scores of a policy on a built-in task (metrics of the last level), with keys unknown to training.

    It is examined as all methods' policies are: observations [observation_size] in, actions [action_size] out.

    Raises:
        UserError: when the training function has left jax with options that change the examination.
    """
    refuse_changed()
    fitted = _fitted(task, policy)

    def score(number: Int[Array, ""]) -> Episode:
        return examine_every_level(task, fitted, kernel_prng(trial_key(number, EVALUATION)))

    with jax.default_matmul_precision(MATMUL_PRECISION):
        final: Episode = jax.device_get(jax.jit(score)(np.int32(seed)))
    return Scores(
        success=tuple(map(float, final.success)),
        fitness=tuple(map(float, final.fitness)),
        metrics={name: float(values[-1]) for name, values in final.metrics.items()},
    )


def fixed_observations(task: Task, count: int) -> NDArray[np.float32]:
    """Return observations that are the same for every policy, shape [count, observation_size]."""
    return np.random.default_rng(0).normal(size=(count, task.observation_size)).astype(np.float32)


def _fitted(task: Task, policy: Callable[[Any], Any]) -> Callable[[Array], Array]:
    """Return a policy that jax can trace: the given one, or else one that calls it on the host.

    A table whose keys are texts, as `table.get(str(observation), 0)`, is traced without an error, and never finds what
    it looks for; one that catches an error, or asks for a type, may act by another rule. So a policy is called on the
    host, too, where its traced action does not depend on the observation, or is not the host's.
    """

    def traced(observation: Array) -> Array:
        return jnp.asarray(policy(observation), jnp.float32)

    def host(observation: Array) -> Any:
        return np.asarray(policy(np.asarray(observation)), np.float32)

    def called(observation: Array) -> Array:
        acted: Array = jax.pure_callback(host, action, observation, vmap_method="sequential")
        return acted

    action = jax.ShapeDtypeStruct((task.action_size,), jnp.float32)
    try:
        program = jax.make_jaxpr(traced)(jax.ShapeDtypeStruct((task.observation_size,), jnp.float32))
    except Exception:  # PyTorch and NumPy each have their own way to refuse what jax traces
        return called
    return traced if _depends(program.jaxpr) and _act_alike(task, traced, host) else called


def _act_alike(task: Task, one: Callable[[Array], Array], host: Callable[[Array], Any]) -> bool:
    """Whether a traced policy acts as on the host, at starts of each level and elsewhere."""
    count = max(LOOKS, task.levels)
    compiled, keys = jax.jit(one), jax.random.split(jax.random.key(0), count)
    levels = jnp.arange(count, dtype=jnp.int32) % task.levels
    with jax.default_matmul_precision(MATMUL_PRECISION):
        starts = jax.jit(jax.vmap(lambda key, level: task.reset(key, level).observation))(keys, levels)
        for observation in (*np.asarray(starts), *fixed_observations(task, LOOKS)):
            try:
                acted = host(observation)
            except Exception:  # it is for jax alone
                return True
            fits = acted.shape == (task.action_size,)  # else the task says what is wrong
            if fits and not np.allclose(compiled(observation), acted, rtol=1e-3, atol=1e-3, equal_nan=True):
                return False
    return True


def _depends(program: Any) -> bool:
    needed = {id(one) for one in program.outvars}
    for step in reversed(program.eqns):
        if any(id(one) in needed for one in step.outvars):
            needed.update(map(id, step.invars))
    return any(id(one) in needed for one in program.invars)
