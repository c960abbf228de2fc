"""evosax's CMA-ES, which decomposes its covariance matrix only where that has changed enough."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
from evosax.algorithms.distribution_based.cma_es import CMA_ES, Params, State, eigen_decomposition
from flax import struct
from jaxtyping import Array, Float, Int, PRNGKeyArray


@struct.dataclass
class _AgingState(State):  # type: ignore[misc]  # flax is not typed
    """evosax's state, with the number of generations since the covariance matrix was decomposed."""

    age: Int[Array, ""]


class AgingCmaEs(CMA_ES):  # type: ignore[misc]  # evosax is not typed
    """evosax's CMA-ES, which decomposes the covariance matrix where it samples, and nowhere else."""

    def __init__(self, replaced: float, *arguments: Any, **settings: Any) -> None:
        """Take the share of the matrix that may be replaced, and what evosax takes."""
        super().__init__(*arguments, **settings)
        self.replaced = replaced

    def _init(self, key: PRNGKeyArray, params: Params) -> _AgingState:
        """Start from the identity, whose decomposition is known."""
        return _AgingState(**vars(super()._init(key, params)), age=jnp.zeros((), jnp.int32))

    def _ask(
        self, key: PRNGKeyArray, state: _AgingState, params: Params
    ) -> tuple[Float[Array, "population parameters"], _AgingState]:
        """Sample a population (Hansen 2016, Eqs. 38 to 40)."""
        is_due = state.age * (params.c_1 + params.c_mu) >= self.replaced
        # A loop of at most one turn: in a batch of trials a conditional would decompose in every generation.
        _, state = jax.lax.while_loop(lambda carry: carry[0], _decomposed, (is_due, state))
        noise = jax.random.normal(key, (self.population_size, self.num_dims))
        population = state.mean + state.std * ((noise * state.D) @ state.B.T)
        return population, state.replace(age=state.age + 1)


def _decomposed(carry: tuple[Array, _AgingState]) -> tuple[Array, _AgingState]:
    """Decompose the covariance matrix; then it is no longer due."""
    is_due, state = carry
    covariance, axes, lengths = eigen_decomposition(state.C)
    return jnp.zeros_like(is_due), state.replace(C=covariance, B=axes, D=lengths, age=jnp.zeros_like(state.age))
