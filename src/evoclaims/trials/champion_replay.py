"""Champions loaded from the store: their parameters as the method's own tree, and their scores."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import jax
import numpy as np
from jaxtyping import Array, Int
from numpy.typing import NDArray

from evoclaims.core.errors import UserError
from evoclaims.core.keys import EVALUATION, TRAINING, trial_key
from evoclaims.core.provenance import differing
from evoclaims.envs.base import Episode
from evoclaims.kernels import kernel_prng
from evoclaims.methods.base import Policy
from evoclaims.trials.devices import MATMUL_PRECISION
from evoclaims.trials.layout import layout_on
from evoclaims.trials.program import examine_every_level
from evoclaims.trials.result import TrialResult
from evoclaims.trials.result_making import named_leaves, provenance
from evoclaims.trials.spec import Condition
from evoclaims.trials.store import Store


@dataclass(frozen=True)
class Replay:
    """A champion's recorded and repeated scores.

    Attributes:
        recorded, again: "success" and "fitness" by name, one value per level.
        elsewhere: parts of the provenance that bits depend on and that differ from the record.
    """

    recorded: Mapping[str, tuple[float, ...]]
    again: Mapping[str, tuple[float, ...]]
    elsewhere: tuple[str, ...]

    @property
    def exact(self) -> bool:
        """Whether every value equals the recorded one; NaN equals NaN."""
        return all(np.array_equal(self.recorded[name], values, equal_nan=True) for name, values in self.again.items())


def load(store: Store, condition: Condition, result: TrialResult) -> Any:
    """Return a stored champion's parameters as the tree that the condition's policies use; leaves on the host.

    Raises:
        DamagedFileError: when the champion's file is missing, torn or not the one that the record names.
        UserError: as `unpacked` does.
    """
    return unpacked(store.champion_of(result), condition, result)


def unpacked(arrays: Mapping[str, NDArray[Any]], condition: Condition, result: TrialResult) -> Any:
    """Return a champion's named arrays as the tree that the condition's policies use.

    Raises:
        UserError: when the trial has no champion, or one that does not fit this tree.
    """
    shapes = jax.eval_shape(lambda: _policy(condition).parameters)
    if result.status in ("timeout", "crashed") or (not arrays and jax.tree.leaves(shapes)):
        raise UserError(f"Seed {result.seed} of {condition.label} has no champion: it is {result.status}.")
    expected = {name: (leaf.shape, leaf.dtype) for name, leaf in named_leaves(shapes).items()}
    if {name: (array.shape, array.dtype) for name, array in arrays.items()} != expected:
        raise UserError(
            f"The champion of {condition.label}, seed {result.seed}, does not have the arrays of this method's "
            "policies, so another version of the code made it. Name another store with --storage, or check that "
            "version out."
        )
    return jax.tree.unflatten(jax.tree.structure(shapes), [arrays[name] for name in expected])


def replay(condition: Condition, result: TrialResult, parameters: Any, devices: Sequence[jax.Device]) -> Replay:
    """Examine a champion on every level again, with the keys of its trial's evaluation."""

    def score(seed: Int[Array, ""], parameters: Any) -> Episode:
        policy = replace(_policy(condition), parameters=parameters)
        return examine_every_level(condition.task, policy, kernel_prng(trial_key(seed, EVALUATION)))

    arguments = jax.tree.map(lambda leaf: np.asarray(leaf)[None], (np.int32(result.seed), parameters))
    layout = layout_on(devices[0].platform)
    with jax.default_matmul_precision(MATMUL_PRECISION):
        compiled = jax.jit(layout.over_trials(score), compiler_options=layout.options(condition))
        episode: Episode = jax.device_get(compiled(*jax.device_put(arguments, devices[0])))
    again = {"success": episode.success[0], "fitness": episode.fitness[0]}
    for name, values in again.items():
        if len(result.levels.get(name, ())) != len(values):
            raise UserError(
                f"The record of {condition.label}, seed {result.seed}, has no {name} for each of the task's "
                f"{len(values)} levels, so there is nothing to compare a replay with: it is {result.status}."
            )
    return Replay(
        recorded={name: result.levels[name] for name in again},
        again={name: tuple(map(float, values)) for name, values in again.items()},
        elsewhere=tuple(sorted(differing(provenance(devices, condition), result.provenance))),
    )


def _policy(condition: Condition) -> Policy:
    """Return an untrained policy of the condition; its trained policies differ only in their parameters."""
    method, task = condition.method, condition.task
    return method.best(task, method.init(trial_key(0, TRAINING), task))
