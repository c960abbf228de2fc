"""HyperNEAT beside its equations: which weights a CPPN draws, which answers they give, and who lives on by these."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import ClassVar, Final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PRNGKeyArray
from numpy.typing import NDArray

from evoclaims.envs.base import Episode, PolicyFn, Task, TaskState, fitting
from evoclaims.methods.hyperneat import CPPN_FUNCTIONS, HyperNeat
from evoclaims.methods.mechanisms.observed import Observed, Question
from evoclaims.methods.neat.evolution import Evolution
from evoclaims.methods.neat.settings import Settings, Species
from evoclaims.networks.genome import Genome

FUNCTIONS: Final = (jnp.tanh, lambda z: jnp.exp(-(z**2)), jnp.sin, jnp.abs, lambda z: z)
"""The CPPN's, in the order of their names."""


@dataclass(frozen=True)
class Portrait(Question):
    """Three numbers are shown, and the nearer the answer to two others the better."""

    name: ClassVar[str] = "portrait"
    packages: ClassVar[tuple[str, ...]] = HyperNeat.packages
    observation_size: ClassVar[int] = 3
    shown: ClassVar[tuple[float, ...]] = (0.9, -0.4, 0.2)
    wanted: ClassVar[tuple[float, ...]] = (0.6, -0.3)

    action_size: int = 2

    def scored(self, answer: Float[Array, " action"]) -> Episode:
        """Return minus the distance."""
        return Episode(fitness=-jnp.linalg.norm(answer - jnp.array(self.wanted)), success=jnp.zeros(()))

    def episode(self, policy: PolicyFn, key: PRNGKeyArray, level: Int[Array, ""]) -> Episode:
        """Ask once."""
        return self.scored(fitting(self, policy(jnp.array(self.shown))))

    def _state(self, reward: Float[Array, ""], *, ended: bool) -> TaskState:
        return replace(super()._state(reward, ended=ended), observation=jnp.array(self.shown))


@dataclass(frozen=True)
class HyperNeatMechanisms(Observed):
    """HyperNEAT whose weights are drawn again: each CPPN is asked, node by node, for every pair of places.

    Metrics:

    * "weights": the share of weights of the population that are those of its CPPNs at the neurons' places (Stanley et
      al. 2009, §3.2).
    * "various": the share of genomes whose weights differ from place to place.
    * "fittest": 1 if the champion is as fit as the best of the networks that are drawn here, and lives on, else 0.
    * "error": how far the answers of these are from the wanted one, averaged over the population.
    """

    of: HyperNeat = HyperNeat(
        Settings(
            population=32,
            nodes=10,
            connections=16,
            activations=CPPN_FUNCTIONS,
            species=Species(most=4, exempt=1, survival=0.25),
        ),
        hidden=(3,),
        extent="unit",
    )
    threshold: float = 0.3
    max_weight: float = 5.0

    def seen(
        self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], before: Evolution, after: Evolution
    ) -> Mapping[str, Float[Array, ""]]:
        """Draw the networks again, and ask them."""
        assert isinstance(task, Portrait)
        genomes = before.population.genomes
        layers = placed((task.observation_size + 1, *self.of.hidden, task.action_size))
        encoding = self.of.encoding(task)
        drawn = jax.vmap(lambda genome: jnp.concatenate([w.ravel() for w in encoding.express(genome)]))(genomes)
        right = jax.vmap(partial(self._weights, layers))(genomes)
        answers = jax.vmap(lambda weights: _answer(weights, [len(layer) for layer in layers], task.shown))(right)
        fitness = jax.vmap(lambda answer: task.scored(answer).fitness)(answers)
        lives = jnp.any(_same(after.population.genomes, after.champion))
        best = jnp.abs(after.episode.fitness - jnp.max(fitness)) < 1e-3
        return {
            "weights": jnp.mean((jnp.abs(drawn - right) < 1e-3).astype(jnp.float32)),
            "various": jnp.mean((jnp.std(right, axis=1) > 0.1).astype(jnp.float32)),
            "fittest": (best & lives).astype(jnp.float32),
            "error": -jnp.mean(fitness),
        }

    def _weights(self, layers: list[NDArray[np.float32]], genome: Genome) -> Float[Array, " connections"]:
        """Return the weights from all neurons of a layer to one of the next, and so on, layer by layer."""
        pairs = [
            np.concatenate([source, target]) for one, other in pairwise(layers) for target in other for source in one
        ]
        q = jax.vmap(partial(_asked, genome))(jnp.array(np.array(pairs)))
        beyond = (jnp.abs(q) - self.threshold) / (1 - self.threshold)
        return jnp.where(beyond > 0, jnp.sign(q) * beyond * self.max_weight, 0.0)


def placed(widths: tuple[int, ...]) -> list[NDArray[np.float32]]:
    """Return the places [neurons, 2] of each layer in the square from (-1, -1) to (1, 1), the inputs at the bottom."""
    layers = []
    for row, width in enumerate(widths):
        across = [2 * i / (width - 1) - 1 if width > 1 else 0.0 for i in range(width)]
        layers.append(np.array([(x, 2 * row / (len(widths) - 1) - 1) for x in across], np.float32))
    return layers


def _asked(genome: Genome, question: Float[Array, " 4"]) -> Float[Array, ""]:
    """Return a CPPN's answer, node by node; a node that no other reaches emits nothing."""
    nodes, genes = genome.nodes, genome.connections
    inputs, output = question.shape[0], question.shape[0]  # the output's key is the first after the inputs' ones

    def fire(slot: Array, state: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        values, reached, answer = state
        leads = genome.has_connection & (genes.target == slot) & reached[genes.source]
        z = nodes.bias[slot] + nodes.response[slot] * jnp.sum(jnp.where(leads, genes.weight * values[genes.source], 0))
        is_output = nodes.key[slot] == output
        value = jnp.where(is_output, z, jax.lax.switch(nodes.activation[slot], FUNCTIONS, z))
        there = jnp.any(leads)
        answer = jnp.where(is_output & there, jnp.tanh(z), answer)
        return values.at[slot].set(jnp.where(there, value, 0.0)), reached.at[slot].set(there), answer

    size = nodes.key.shape[0]
    values = jnp.zeros(size).at[:inputs].set(question)
    start = values, jnp.arange(size) < inputs, jnp.zeros(())
    answer: Array = jax.lax.fori_loop(inputs, size, fire, start)[2]
    return answer


def _answer(
    weights: Float[Array, " connections"], widths: list[int], shown: tuple[float, ...]
) -> Float[Array, " action"]:
    """Return what a network of tanh neurons answers; the last input is 1."""
    signal, first = jnp.array([*shown, 1.0]), 0
    for width in widths[1:]:
        size = width * signal.shape[0]
        signal, first = jnp.tanh(weights[first : first + size].reshape(width, -1) @ signal), first + size
    return signal


def _same(genomes: Genome, one: Genome) -> Array:
    """Return which genomes have all the genes of one."""
    equal = jax.tree.map(
        lambda leaf, of_one: jnp.all((leaf == of_one[None]).reshape(leaf.shape[0], -1), axis=1), genomes, one
    )
    return jnp.all(jnp.stack(jax.tree.leaves(equal)), axis=0)
