"""CMA-ES's recombination weights, and what ties would do to it without them."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from evosax.algorithms.distribution_based.cma_es import CMA_ES
from hypothesis import given, settings
from hypothesis import strategies as st

from evoclaims.core.errors import UserError
from evoclaims.core.pytree import strong
from evoclaims.methods.cma_es import CmaEs, ordinal_weights
from evoclaims.methods.foreign import implicit_promotions

DIMENSIONS, POPULATION = 5, 16


class Params:
    """What `ordinal_weights` reads of evosax's parameters."""

    weights = jnp.linspace(1.0, -1.0, POPULATION)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.sampled_from([-2.0, -0.5, 0.0, 0.5, 2.0]), min_size=POPULATION, max_size=POPULATION))
def test_the_ith_best_gets_the_ith_weight_and_ties_go_by_index(fitness: list[float]) -> None:
    given_weights = ordinal_weights(jnp.zeros((POPULATION, 1)), jnp.array(fitness), None, Params)
    wanted = np.empty(POPULATION, np.float32)
    wanted[np.argsort(np.array(fitness), kind="stable")] = np.asarray(Params.weights)
    np.testing.assert_array_equal(given_weights, wanted)


def test_no_weight_is_averaged_away_however_many_tie() -> None:
    shaped = ordinal_weights(jnp.zeros((POPULATION, 1)), jnp.zeros(POPULATION), None, Params)
    np.testing.assert_array_equal(shaped, Params.weights)


def _step_sizes(shaping: dict[str, Any], generations: int) -> np.ndarray[Any, Any]:
    """Run evosax's CMA-ES where every individual ties; return σ after each generation."""
    with implicit_promotions():
        search = CMA_ES(POPULATION, jnp.zeros(DIMENSIONS), **shaping)
        params = search.default_params
        state = search.init(jax.random.key(0), jnp.zeros(DIMENSIONS), params)

        def generation(state: Any, key: jax.Array) -> tuple[Any, jax.Array]:
            population, state = search.ask(jax.random.fold_in(key, 0), state, params)
            state, _ = search.tell(jax.random.fold_in(key, 1), population, jnp.zeros(POPULATION), state, params)
            return strong(state), state.std

        keys = jax.random.split(jax.random.key(2), generations)
        return np.asarray(jax.jit(lambda state: jax.lax.scan(generation, state, keys)[1])(strong(state)))


def test_on_ties_evosaxs_own_shaping_collapses_the_step_size_and_ordinal_weights_do_not() -> None:
    collapsed, alive = _step_sizes({}, 300), _step_sizes({"fitness_shaping_fn": ordinal_weights}, 300)
    assert (np.diff(collapsed[:50]) < 0).all()
    assert np.nanmin(collapsed) < 1e-12
    assert np.isnan(collapsed[-1])  # (x - mean) / 0
    assert alive.min() > 1e-2
    assert alive.max() < 1e2


def test_the_step_size_is_on_the_training_curve_and_stays_positive(benches: dict[str, Any]) -> None:
    _, reports = benches["cma_es"].run(30, seed=3)
    assert all(float(progress.metrics["step_size"]) > 1e-3 for progress in reports)


def test_it_starts_from_a_standard_normal_distribution_whatever_the_key(benches: dict[str, Any]) -> None:
    state = benches["cma_es"].init(seed=5).distribution
    assert float(state.std) == 1.0
    np.testing.assert_array_equal(state.mean, np.zeros(state.mean.shape))
    np.testing.assert_array_equal(state.C, np.eye(len(state.mean)))


def test_the_mean_moves_by_the_weighted_best_half(benches: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """Hansen 2016, Eqs. (41), (42) and (49), from the population that was evaluated, by loops."""
    bench, seen = benches["cma_es"], []
    original = CMA_ES.tell

    def watched(self: Any, key: Any, population: Any, fitness: Any, state: Any, params: Any) -> Any:
        seen[:] = population, fitness
        return original(self, key, population, fitness, state, params)

    monkeypatch.setattr(CMA_ES, "tell", watched)

    @jax.jit
    def generation(state: Any) -> tuple[Any, ...]:
        return bench.plain_step(jax.random.key(2), jnp.zeros((), jnp.int32), state)[0].distribution.mean, *seen

    after, population, fitness = map(np.asarray, generation(bench.init()))
    assert (fitness >= 0).all()  # evosax minimizes: it is told errors, of which some individual makes one
    assert fitness.max() > 0
    n = len(population)
    log_weights = [np.log((n + 1) / 2) - np.log(rank + 1) for rank in range(n)]
    positive = sum(weight for weight in log_weights if weight > 0)
    order = sorted(range(n), key=lambda individual: (fitness[individual], individual))
    mean = sum(
        weight / positive * population[individual].astype(np.float64)
        for weight, individual in zip(log_weights, order, strict=True)
        if weight > 0
    )
    np.testing.assert_allclose(after, mean, atol=1e-5)


def test_a_population_too_small_to_recombine_is_one_sentence() -> None:
    with pytest.raises(UserError, match="population of at least 4, not 3"):
        CmaEs(3)
