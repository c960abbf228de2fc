"""CMA-ES with few eigendecompositions: when there is one, and that nothing else differs from CMA-ES."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from test_cma_es import POPULATION, Ellipsoid, Itself

from evoclaims.core.errors import UserError
from evoclaims.methods.cma_es import CmaEs, CmaEsState, SeldomDecomposedCmaEs
from evoclaims.methods.flat_champion import first_champion

pytestmark = pytest.mark.newest

GENERATIONS = 40
FEW = 6
"""Generations before rounding makes two programs differ."""
SIZE, SHARE = 20, 0.1
TASK: Any = Ellipsoid(SIZE)
NETWORK: Any = Itself()
SEARCHED = "mean", "std", "p_std", "p_c", "C"


def _distributions(method: CmaEs, seeds: list[int]) -> Any:
    """Run a method from several seeds at once; return its distributions after each generation, [seed, generation]."""

    def trial(seed: Any) -> Any:
        def generation(state: Any, key: Any) -> tuple[Any, Any]:
            state, _ = method.step(key, TASK, jnp.zeros((), jnp.int32), state)
            return state, state.distribution

        key = jax.random.key(seed)
        return jax.lax.scan(generation, method.init(key, TASK), jax.random.split(key, GENERATIONS))[1]

    return jax.tree.map(np.asarray, jax.jit(jax.vmap(trial))(jnp.array(seeds)))


def _turns(axes: Any) -> list[int]:
    """Return the generations in which the axes of a distribution differ from those of the generation before."""
    before = np.concatenate([np.eye(axes.shape[-1])[None], axes[:-1]])
    return [int(i) for i in np.flatnonzero((axes != before).any(axis=(1, 2)))]


def test_with_a_share_of_0_a_generation_is_that_of_cma_es() -> None:
    plain, seldom = CmaEs(POPULATION, NETWORK), SeldomDecomposedCmaEs(POPULATION, NETWORK, replaced=0.0)
    aged = jax.tree.map(lambda leaf: leaf[0, 30], _distributions(seldom, [1]))
    key, level, champion = jax.random.key(4), jnp.zeros((), jnp.int32), first_champion(jnp.zeros(SIZE))
    start = replace(plain.init(key, TASK).distribution, **{name: getattr(aged, name) for name in SEARCHED})
    (theirs, _), (ours, _) = (
        jax.jit(lambda state, method=method: method.step(key, TASK, level, state))(CmaEsState(distribution, champion))
        for method, distribution in ((plain, start), (seldom, aged))
    )
    assert not np.array_equal(ours.distribution.B, aged.B)
    for name in SEARCHED:
        found, wanted = (getattr(each.distribution, name) for each in (ours, theirs))
        np.testing.assert_allclose(found, wanted, rtol=1e-5, atol=1e-6, err_msg=name)


def test_the_matrix_is_decomposed_when_generations_have_replaced_the_share() -> None:
    method = SeldomDecomposedCmaEs(POPULATION, NETWORK, replaced=SHARE)
    _, params = method._search(TASK)
    rate = float(params.c_1 + params.c_mu)
    gap = int(np.ceil(SHARE / rate))
    assert gap > 2
    found = _distributions(method, [1, 2])
    for axes, lengths in zip(found.B, found.D, strict=True):
        assert _turns(axes) == list(range(gap, GENERATIONS, gap))
        assert (lengths[:gap] == 1).all()
    assert found.age[0].tolist() == [1 + i % gap for i in range(GENERATIONS)]


def test_samples_are_of_the_matrix_as_last_decomposed_and_it_learns_all_the_same() -> None:
    found = _distributions(SeldomDecomposedCmaEs(POPULATION, NETWORK, replaced=SHARE), [3])
    axes, lengths = found.B[0, -1], found.D[0, -1]
    turn = _turns(found.B[0])[-1]
    covariance = (axes * lengths**2) @ axes.T
    np.testing.assert_allclose(covariance, found.C[0, turn - 1], rtol=1e-4, atol=1e-5)
    errors = np.sum(np.geomspace(1.0, 100.0, SIZE) * (found.mean[0] - 1.0) ** 2, axis=1)
    assert errors[-1] < 0.2 * errors[0]


def test_a_trial_is_the_same_alone_and_in_a_batch() -> None:
    method = SeldomDecomposedCmaEs(POPULATION, NETWORK, replaced=SHARE)
    alone, batch = _distributions(method, [7]), _distributions(method, [7, 8, 9])
    np.testing.assert_array_equal(alone.age[0], batch.age[0])
    np.testing.assert_allclose(alone.C[0, :FEW], batch.C[0, :FEW], atol=1e-5)


@pytest.mark.parametrize("share", [-0.1, 1.0, float("nan")])
def test_a_share_that_is_none_is_refused(share: float) -> None:
    with pytest.raises(UserError, match="Write a number from 0 to below 1"):
        SeldomDecomposedCmaEs(replaced=share)
