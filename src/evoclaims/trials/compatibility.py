"""Whether a method and a task fit together: the shapes and types they exchange, checked by tracing before compiling.

jax broadcasts silently. A policy whose action is a scalar would be scored wrongly, and its claim refuted.
"""

from __future__ import annotations

import operator
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final, SupportsIndex

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int

from evoclaims.core.errors import UserError
from evoclaims.core.keys import TRAINING, trial_key
from evoclaims.core.pytree import strong
from evoclaims.envs.base import Episode, MisfitError, Task, TaskState, fitting
from evoclaims.kernels import kernel_prng
from evoclaims.methods.base import Method, Policy, Progress
from evoclaims.trials.result import SHARES

_NUMBER = jax.ShapeDtypeStruct((), jnp.int32)

CURVES: Final = ("steps", "environment_steps", "level", "fitness", "success")
"""Names of a training curve that the engine writes."""

METRICS: Final = (
    *SHARES,
    *("last_fitness", "furthest_solved", "furthest_reached", "steps", "environment_steps"),
)
"""Names of a result's metrics that the engine writes."""


@contextmanager
def both_named(method: Method[Any], task: Task) -> Iterator[None]:
    """Name method and task in the error about a misfit, and in a note on any other.

    Raises:
        UserError: instead of a `MisfitError`.
    """
    try:
        yield
    except MisfitError as error:
        raise UserError(f"The method {method.name!r} does not fit the task {task.name!r}: {error.clause}.") from error
    except UserError:  # says it all
        raise
    except Exception as error:
        error.add_note(f"The method {method.name!r} was tried on the task {task.name!r}.")
        raise


def traced_progress(method: Method[Any], task: Task) -> Progress:
    """Return the shapes of what a step of `method` on `task` reports, after checking all that they exchange.

    Each part is traced once, the slowest parts last. Nothing is compiled.

    Raises:
        UserError: when something has a wrong shape, type or structure; names both.
    """
    with both_named(method, task):
        for name, least in (("observation_size", 0), ("action_size", 1), ("horizon", 1), ("levels", 1)):
            size = getattr(task, name)
            if not (isinstance(size, SupportsIndex) and operator.index(size) >= least):
                raise MisfitError(f"{task.name!r} has {name} = {size!r}, and it takes a whole number, at least {least}")
        begun, shown = jax.make_jaxpr(lambda seed, level: task.reset(_key(seed), level), return_shape=True)(
            _NUMBER, _NUMBER
        )
        _check_task_state(task, "reset", shown)
        program = begun.jaxpr
        read = [*program.outvars, *(given for equation in program.eqns for given in equation.invars)]
        if task.levels > 1 and not any(program.invars[1] is one for one in read):
            raise MisfitError(
                f"{task.name!r} has {task.levels} levels, and its reset does the same on all of them: it does not read "
                "`level`"
            )
        before = jax.eval_shape(lambda seed: strong(method.init(_key(seed), task)), _NUMBER)
        jax.eval_shape(lambda state, seen: fitting(task, _policy(method, task, state)(seen)), before, shown.observation)
        action = jax.ShapeDtypeStruct((task.action_size,), jnp.float32)
        following: TaskState = jax.eval_shape(task.step, shown, action)
        _check_task_state(task, "step", following)
        _check_unchanged(f"{task.name!r} changes its state by a step", shown.inner, following.inner)

        def step(seed: Int[Array, ""], level: Int[Array, ""], state: Any) -> tuple[Any, Progress]:
            returned: object = method.step(_key(seed), task, level, state)
            if not (isinstance(returned, tuple) and len(returned) == 2):
                raise MisfitError(
                    f"a step of {method.name!r} returns {_kind(returned)}, not two values: state, Progress(...)"
                )
            after, progress = returned
            return strong(after), progress

        try:
            after, progress = jax.eval_shape(step, _NUMBER, _NUMBER, before)
        except UserError:
            raise
        except Exception:
            _check_episode(method, task, before)  # it may be to blame, and is seldom: tracing it takes as long again
            raise
        _check_unchanged(f"{method.name!r} changes its state by a step", before, after)
        return _checked_progress(method, progress)


def _policy(method: Method[Any], task: Task, state: Any) -> Policy:
    policy = method.best(task, state)
    what = f"'best' of {method.name!r} returns"
    if not isinstance(policy, Policy):
        raise MisfitError(f"{what} {_kind(policy)}, not Policy(parameters, function)")
    if not callable(policy.function):
        raise MisfitError(f"{what} a Policy with {policy.function!r} as its function, which cannot be called")
    odd = [leaf for leaf in jax.tree.leaves(policy.parameters) if not _is_array(leaf)]
    if odd:
        raise MisfitError(
            f"{what} a Policy with {odd[0]!r} among its parameters, which are arrays: jnp.asarray makes one"
        )
    return policy


def _check_episode(method: Method[Any], task: Task, state: Any) -> None:
    """Check what an episode of a task returns, where something fails that plays one; other errors are not its own.

    Raises:
        MisfitError: when it is no `Episode`, or its numbers are none.
    """

    def play(seed: Int[Array, ""], level: Int[Array, ""], state: Any) -> None:
        episode: object = task.episode(_policy(method, task, state), _key(seed), level)
        what = f"an episode of {task.name!r} gives"
        if not isinstance(episode, Episode):
            raise MisfitError(f"{what} {_kind(episode)}, not an Episode")
        for name, leaf in (("fitness", episode.fitness), ("success", episode.success)):
            if not isinstance(leaf, float):  # which jax takes for an array
                _check(f"{what} a {name}", leaf, (), jnp.float32)

    try:
        jax.eval_shape(play, _NUMBER, _NUMBER, state)
    except UserError:
        raise
    except Exception:
        return


def check_scores(task: Task, final: Episode) -> None:
    """Check an examination's results on every level, leaves [levels].

    Raises:
        MisfitError: when one is not a number for each level.
    """
    what = f"the examination by {task.name!r} gives"
    if not isinstance(final, Episode):
        raise MisfitError(f"{what} {_kind(final)}, not an Episode")
    for name, leaf in (("fitness", final.fitness), ("success", final.success)):
        _check(f"{what} a {name}", leaf, (task.levels,), jnp.float32)
    _check_numbers(what, final.metrics, (task.levels,), METRICS)


def _key(seed: Int[Array, ""]) -> Array:
    return kernel_prng(trial_key(seed, TRAINING))


def _check_task_state(task: Task, function: str, state: TaskState) -> None:
    what = f"the {function} of {task.name!r} gives"
    if not isinstance(state, TaskState):
        raise MisfitError(f"{what} {_kind(state)}, not a TaskState")
    _check(f"{what} an observation", state.observation, (task.observation_size,), jnp.float32)
    _check(f"{what} a reward", state.reward, (), jnp.float32)
    _check(f"{what} a mark `terminated`", state.terminated, (), jnp.bool_)
    _check(f"{what} a mark `truncated`", state.truncated, (), jnp.bool_)


def _checked_progress(method: Method[Any], progress: object) -> Progress:
    what = f"a step of {method.name!r} reports"
    if not isinstance(progress, Progress):
        raise MisfitError(f"{what} {_kind(progress)}, and the engine takes a Progress")
    _check(f"{what} a fitness", progress.fitness, (), jnp.float32)
    _check(f"{what} a success", progress.success, (), jnp.float32)
    _check(f"{what} a mark `healthy`", progress.healthy, (), jnp.bool_)
    _check_numbers(what, progress.metrics, (), CURVES)
    return progress


def _check_numbers(what: str, metrics: object, shape: tuple[int, ...], taken: Collection[str]) -> None:
    """Check that metrics are real numbers of one shape by name, none of them a name of the engine's own in `taken`."""
    if not isinstance(metrics, Mapping):
        raise MisfitError(
            f"{what} {_kind(metrics)} as its metrics, not a table such as {{'gap': gap}} ({{}} if it has none)"
        )
    for name, leaf in metrics.items():
        if not isinstance(name, str):
            raise MisfitError(f"{what} a metric {name!r}, whose name is not text: write it in quotes")
        if name in taken:
            raise MisfitError(f"{what} a metric {name!r}, which the engine itself uses: give it another name")
        real = _is_array(leaf) and (np.can_cast(leaf.dtype, np.float64) or leaf.dtype == jnp.bfloat16)
        if not real or leaf.shape != shape:
            raise MisfitError(f"{what} a metric {name!r} of {_described(leaf)}, not a real number of shape {shape}")


def _check(what: str, leaf: Any, shape: tuple[int, ...], dtype: Any) -> None:
    if not _is_array(leaf) or (leaf.shape, leaf.dtype) != (shape, np.dtype(dtype)):
        raise MisfitError(f"{what} of {_described(leaf)}, not of shape {shape} and type {np.dtype(dtype)}")


def _check_unchanged(what: str, before: Any, after: Any) -> None:
    """Check that a state keeps its structure, and each of its arrays its shape and type."""
    structure: Any = jax.tree.structure(before)
    if structure != jax.tree.structure(after):
        raise MisfitError(f"{what}: its structure is another one afterwards")
    paths = jax.tree_util.tree_flatten_with_path(before)[0]
    for (path, was), now in zip(paths, jax.tree.leaves(after), strict=True):
        if (was.shape, was.dtype) != (now.shape, now.dtype):
            place = jax.tree_util.keystr(path) or "it"
            raise MisfitError(f"{what}: {place} is of {_described(was)} before and of {_described(now)} afterwards")


def _is_array(leaf: object) -> bool:
    """Whether there is one array, or the shape of one; a list of arrays is not one."""
    return hasattr(leaf, "shape") and hasattr(leaf, "dtype")


def _kind(value: object) -> str:
    """Return in words what stands in the place of something else."""
    if value is None:
        return "None (without a `return`?)"
    return "an array" if _is_array(value) else f"a {type(value).__name__}"


def _described(leaf: Any) -> str:
    return f"shape {leaf.shape} and type {leaf.dtype}" if _is_array(leaf) else f"{_kind(leaf)}, which is not an array"
