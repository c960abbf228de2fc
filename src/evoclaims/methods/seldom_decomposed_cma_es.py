"""CMA-ES for networks of thousands of parameters: its covariance matrix is decomposed only now and then."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
from evosax.algorithms.distribution_based.cma_es import CMA_ES, Params, State, eigen_decomposition
from flax import struct
from jaxtyping import Array, Float, Int, PRNGKeyArray

from evoclaims.core.errors import UserError
from evoclaims.methods.cma_es import CmaEs


@dataclass(frozen=True)
class SeldomDecomposedCmaEs(CmaEs):
    """CMA-ES that samples with the covariance matrix of some generations ago.

    The time of an eigendecomposition grows with the cube of the number n of parameters, and a generation changes a
    large matrix little: the learning rates c_1 + c_μ fall with n² (Hansen 2016, Eqs. 57 and 58). Hansen's
    implementations decompose it again when generations have replaced a share of 0.1 / n of it (ibid., §B.2). That is
    every third generation for 3,425 parameters and 256 individuals, whose generations replace 1e-5 of it.

    Attributes:
        population: individuals per generation (λ).
        network: the policy's network, whose parameters are evolved.
        replaced: share of the matrix that generations replace, Σ (c_1 + c_μ), before it is decomposed again. With 0
            it is decomposed in every generation, as by `CmaEs`.
    """

    name: ClassVar[str] = "seldom_decomposed_cma_es"
    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ("evosax", "flax")

    replaced: float = 0.01

    def __post_init__(self) -> None:
        """Check the population size and the share."""
        super().__post_init__()
        if not 0.0 <= self.replaced < 1.0:
            raise UserError(
                f"SeldomDecomposedCmaEs has replaced={self.replaced}, a share of the covariance matrix. Write a "
                "number from 0 to below 1."
            )

    def _kept(self, distribution: Any) -> Any:
        """Return all of it: the next generations sample with these eigenvectors."""
        return distribution

    @property
    def _algorithm(self) -> Callable[..., CMA_ES]:
        """Return what makes the search."""
        return partial(_SeldomDecomposed, self.replaced)


@struct.dataclass
class _AgingState(State):  # type: ignore[misc]  # flax is not typed
    """evosax's state, with the number of generations since the covariance matrix was decomposed."""

    age: Int[Array, ""]


class _SeldomDecomposed(CMA_ES):  # type: ignore[misc]  # evosax is not typed
    """evosax's CMA-ES, which decomposes the covariance matrix where it samples, and nowhere else."""

    def __init__(self, replaced: float, *arguments: Any, **settings: Any) -> None:
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
