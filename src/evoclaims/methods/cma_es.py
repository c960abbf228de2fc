"""CMA-ES (Hansen 2016, arXiv:1604.00772) by evosax, over the parameters of a fixed network."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, Final

import jax.numpy as jnp
from jax.custom_batching import sequential_vmap
from jaxtyping import Array, Float, Int, PRNGKeyArray

from evoclaims.core.errors import UserError
from evoclaims.core.foreign import Later, implicit_promotions
from evoclaims.core.keys import streams
from evoclaims.core.pytree import pytree, strong
from evoclaims.envs.base import Task
from evoclaims.methods.base import Policy, Progress
from evoclaims.methods.flat_champion import Champion, champion_policy, evaluate_with_champion, first_champion
from evoclaims.networks.all_skips import AllSkips
from evoclaims.networks.base import Network

evosax = Later("evosax.algorithms.distribution_based.cma_es")

LARGE: Final = 1_000
"""Covariance matrices of so many rows are decomposed one after the other, not as a batch of trials.

An H200 takes 142 ms for a batch of five matrices of 1,588 rows, hardly less than for ten, and 16.7 ms for one.
"""


@pytree
class CmaEsState:
    """The search distribution (evosax's own state, without eigenvectors) and the best individual seen."""

    distribution: Any
    champion: Champion


def ordinal_weights(
    population: Float[Array, "n parameters"], fitness: Float[Array, " n"], state: Any, params: Any
) -> Float[Array, " n"]:
    """Give the i-th best individual the i-th recombination weight; ties are ordered by index.

    evosax's default averages the ranks of ties. With a thresholded fitness most of a population ties, the averaged
    weights cancel, and the step size collapses. Individuals are drawn independently, so the order by index is random.
    """
    weights: Array = params.weights[jnp.argsort(jnp.argsort(fitness, stable=True), stable=True)]
    return weights


@dataclass(frozen=True)
class CmaEs:
    """evosax's CMA-ES with its default parameters and ordinal recombination weights.

    Attributes:
        population: individuals per generation (λ).
        network: the policy's network, whose parameters are evolved.
    """

    name: ClassVar[str] = "cma_es"
    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ("evosax",)

    population: int = 256
    network: Network = AllSkips()

    def __post_init__(self) -> None:
        """Check the population size: the better half recombines, with weights by rank."""
        if self.population < 4:
            raise UserError(f"CMA-ES has population={self.population}. Write at least 4.")

    def init(self, key: PRNGKeyArray, task: Task) -> CmaEsState:
        """Start from N(0, 1), evosax's default; the key is not used."""
        search, params = self._search(task)
        mean = jnp.zeros(self.network.size(task.observation_size, task.action_size))
        with implicit_promotions():
            distribution = search.init(key, mean, params)
        return CmaEsState(distribution=self._kept(strong(distribution)), champion=first_champion(mean))

    def step(
        self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: CmaEsState
    ) -> tuple[CmaEsState, Progress]:
        """Sample, evaluate and update for one generation."""
        ask_key, episode_key, tell_key = streams(key, "ask", "episode", "tell")
        search, params = self._search(task)
        with implicit_promotions():
            ask = sequential_vmap(search.ask) if search.num_dims >= LARGE else search.ask
            population, distribution = ask(ask_key, state.distribution, params)
        episodes, champion, healthy = evaluate_with_champion(
            self.network, task, episode_key, level, population, state.champion
        )
        # evosax minimizes.
        with implicit_promotions():
            distribution, _ = search.tell(tell_key, population, -episodes.fitness, distribution, params)
        progress = Progress(
            fitness=champion.episode.fitness,
            success=champion.episode.success,
            healthy=healthy & jnp.all(jnp.isfinite(distribution.mean)),
            metrics={"step_size": distribution.std},
        )
        return CmaEsState(distribution=self._kept(strong(distribution)), champion=champion), progress

    def best(self, task: Task, state: CmaEsState) -> Policy:
        """Return the champion."""
        return champion_policy(self.network, task, state.champion)

    def cost(self, task: Task) -> int:
        """Return the environment steps of one generation, at the longest episode, but for the champion's own."""
        return self.population * task.horizon

    def _search(self, task: Task) -> tuple[Any, Any]:
        """Build evosax's algorithm and its default parameters for the task's encoding."""
        size = self.network.size(task.observation_size, task.action_size)
        search = self._algorithm(
            self.population, jnp.zeros(size), fitness_shaping_fn=ordinal_weights, metrics_fn=lambda *_: {}
        )
        with implicit_promotions():
            return search, search.default_params

    def _kept(self, distribution: Any) -> Any:
        """Return what the next generation needs of a distribution.

        evosax decomposes the covariance matrix before it samples; the eigenvectors would be half of a checkpoint.
        """
        return distribution.replace(B=jnp.zeros((0, 0)), D=jnp.zeros((0,)))

    @property
    def _algorithm(self) -> Callable[..., Any]:
        algorithm: Callable[..., Any] = evosax.CMA_ES
        return algorithm


aging_cma_es = Later("evoclaims.methods.aging_cma_es")


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
    def _algorithm(self) -> Callable[..., Any]:
        return partial(aging_cma_es.AgingCmaEs, self.replaced)
