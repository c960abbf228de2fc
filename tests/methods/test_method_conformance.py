"""What every method keeps to, so that one engine can run them all."""

from __future__ import annotations

import importlib
import pkgutil
from dataclasses import is_dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from small_methods import METHODS, Entry
from workbench import Workbench, close, same_bits

import evoclaims.methods
from evoclaims.core.canonical import canonical_json
from evoclaims.methods.base import PartlyUsed
from evoclaims.methods.training_loop import TrainingLoop
from evoclaims.trials.result_making import is_sound

LEVEL = jnp.zeros((), jnp.int32)


def _shapes(tree: Any) -> list[tuple[Any, ...]]:
    return [(leaf.shape, leaf.dtype) for leaf in jax.tree.leaves(tree)]


def test_the_state_keeps_its_structure_shapes_and_strong_dtypes(bench: Workbench) -> None:
    before = jax.eval_shape(bench.init)
    after, _ = jax.eval_shape(bench.plain_step, jax.random.key(0), LEVEL, before)
    assert jax.tree.structure(before) == jax.tree.structure(after)
    assert _shapes(before) == _shapes(after)
    assert not [leaf for leaf in jax.tree.leaves((before, after)) if leaf.weak_type]


def test_progress_is_scalars_of_the_same_names_at_every_step(bench: Workbench) -> None:
    _, (first, *_, last) = bench.run(3)
    assert jax.tree.structure(first) == jax.tree.structure(last)
    for progress in (first, last):
        assert {leaf.shape for leaf in jax.tree.leaves(progress)} == {()}
        assert progress.fitness.dtype == progress.success.dtype == jnp.float32
        assert progress.healthy.dtype == jnp.bool_
        assert bool(progress.healthy)
        assert np.isfinite(float(progress.fitness))
        assert 0.0 <= float(progress.success) <= 1.0


def test_stepping_compiles_once(bench: Workbench) -> None:
    bench.run(1)  # compiled programs may have been forgotten since another test compiled them
    traces = bench.traces
    for level in range(bench.task.levels):
        bench.run(2, level=level)
    assert bench.traces == traces


def test_the_same_key_gives_the_same_state(bench: Workbench) -> None:
    one, other = bench.run(2, seed=4), bench.run(2, seed=4)
    assert same_bits(one, other)


def test_another_key_gives_another_state_where_a_method_learns(entry: Entry, bench: Workbench) -> None:
    state = bench.init()
    one, _ = bench.run(1, seed=4, state=state)
    other, _ = bench.run(1, seed=5, state=state)
    assert same_bits(one, other) != entry.learns


@pytest.mark.newest  # smoke compiles each method's trials side by side
def test_trials_side_by_side_in_a_loop_are_the_trials_one_by_one(bench: Workbench) -> None:
    seeds = (3, 8)
    alone = [bench.run(1, seed=seed)[0] for seed in seeds]
    keys = jnp.stack([jax.random.key(seed + 1) for seed in seeds])
    starts = jax.tree.map(lambda *leaf: jnp.stack(leaf), *[bench.init(seed) for seed in seeds])

    def trial(key: Any, steps: Any, state: Any) -> Any:
        def body(carry: Any) -> Any:
            step, state = carry
            return step + 1, bench.plain_step(jax.random.fold_in(key, step), LEVEL, state)[0]

        return jax.lax.while_loop(lambda carry: carry[0] < steps, body, (LEVEL, state))[1]

    side_by_side = jax.jit(jax.vmap(trial, in_axes=(0, None, 0)))
    with jax.debug_key_reuse(False):  # jax takes the keys of any loop under vmap for used
        together = side_by_side(keys, jnp.int32(1), starts)
    for i, one in enumerate(alone):
        close(one, jax.tree.map(lambda leaf, i=i: leaf[i], together), tolerance=1e-4)


def test_progress_is_what_an_examination_of_the_best_policy_says(entry: Entry, bench: Workbench) -> None:
    if not entry.examines:
        _, (progress,) = bench.run(1)
        assert (float(progress.fitness), float(progress.success), dict(progress.metrics)) == (0.0, 0.0, {})
        return
    told = set()
    for seed in range(4):
        for level in range(bench.task.levels):
            state, reports = bench.run(1, seed=seed, level=level)
            examined = bench.examine(state, level)
            np.testing.assert_allclose(float(reports[-1].fitness), float(examined.fitness), atol=1e-6)
            np.testing.assert_allclose(float(reports[-1].success), float(examined.success), atol=1e-6)
            told.add(float(examined.success))
    assert told - {0.5}, "an answer that is right half of the time shows too little"


def test_the_best_policy_answers_alike_each_time_and_only_by_its_parameters(bench: Workbench) -> None:
    one, other = (bench.method.best(bench.task, bench.run(2, seed=6)[0]) for _ in range(2))
    act = jax.jit(lambda parameters, seen: one.function(parameters, seen))
    observation = jnp.ones(bench.task.observation_size)
    answer = act(one.parameters, observation)
    assert answer.shape == (bench.task.action_size,)
    assert same_bits(answer, act(other.parameters, observation))
    assert same_bits(act(one.parameters, observation), answer)
    assert same_bits(one.parameters, other.parameters)


def test_numbers_that_are_not_finite_are_told_as_unhealthy(entry: Entry, bench: Workbench) -> None:
    state, _ = bench.run(1)
    if not entry.learns:  # it acts by what it has drawn, and nothing of that ever changes
        before, after = (bench.method.best(bench.task, one).parameters for one in (bench.init(), state))
        assert same_bits(before, after)
        return
    poisoned = jax.tree.map(lambda x: x * jnp.nan if jnp.issubdtype(x.dtype, jnp.floating) else x, state)
    _, (progress,) = bench.run(1, state=poisoned)
    assert not bool(progress.healthy)


def test_a_policy_is_sound_until_a_number_that_it_acts_by_is_not_finite(bench: Workbench) -> None:
    used = bench.method.used if isinstance(bench.method, PartlyUsed) else lambda parameters: parameters
    for state in (bench.init(), bench.run(2)[0]):
        parameters = jax.device_get(bench.method.best(bench.task, state).parameters)
        assert is_sound(bench.method, parameters)
    leaves, structure = jax.tree.flatten(parameters)
    spoilt = 0
    for index, leaf in enumerate(leaves):
        for worst in (np.nan, np.inf) if np.issubdtype(leaf.dtype, np.floating) else ():
            bad = leaf.copy()
            bad.flat[0] = worst
            tree = jax.tree.unflatten(structure, [*leaves[:index], bad, *leaves[index + 1 :]])
            acts_by_it = not same_bits(used(tree), used(parameters))
            assert is_sound(bench.method, tree) != acts_by_it
            spoilt += acts_by_it
    assert spoilt


def test_the_best_never_worsens_where_evaluation_is_deterministic(entry: Entry, bench: Workbench) -> None:
    if entry.keeps_the_best:
        gains = []
        for level, seed in ((0, 0), (1, 1), (1, 2)):
            _, reports = bench.run(25, seed=seed, level=level)
            fitness = [float(progress.fitness) for progress in reports]
            assert fitness == sorted(fitness)
            gains.append(fitness[-1] - fitness[0])
        assert max(gains) > 0


def test_every_method_is_on_the_list() -> None:
    """Or a new one would be held to nothing. Training loops of other libraries train elsewhere, in one step.

    Mechanisms observe methods of the list, and claims hold them to what they observe.
    """
    modules = [
        importlib.import_module(module.name)
        for module in pkgutil.walk_packages(evoclaims.methods.__path__, "evoclaims.methods.")
    ]
    parts = ("init", "step", "best", "cost")
    found = {
        kind
        for module in modules
        for kind in vars(module).values()
        if not module.__name__.startswith("evoclaims.methods.mechanisms")
        and isinstance(kind, type)
        and is_dataclass(kind)
        and all(callable(getattr(kind, part, None)) for part in parts)
    }
    assert found - {type(entry.method) for entry in METHODS.values()} == {TrainingLoop}


def test_the_cost_is_the_environment_steps_of_one_step(entry: Entry) -> None:
    assert entry.method.cost(entry.task) == entry.cost


def test_a_method_is_hashable_and_has_a_canonical_form(entry: Entry, name: str) -> None:
    assert hash(entry.method) == hash(type(entry.method)(**_parameters(entry.method)))
    assert canonical_json(entry.method) != canonical_json(entry.other)
    assert entry.method.name == name
    assert entry.method.revision >= 1


def _parameters(method: Any) -> dict[str, Any]:
    return {field: getattr(method, field) for field in method.__dataclass_fields__ if field in vars(method)}
