"""The real TensorNEAT (Wang et al. 2024) as a method, if it is installed; our NEAT is compared with it.

Its own code does everything except evaluation, which the task does. It stores the historical markings of genes as
32-bit floats: after 2²⁴ / population generations, markings of new nodes are no longer unique.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from evoclaims.core.errors import UserError
from evoclaims.core.foreign import implicit_promotions
from evoclaims.core.keys import streams
from evoclaims.core.pytree import pytree, strong
from evoclaims.envs.base import Episode, PolicyFn, Task
from evoclaims.methods.base import Policy, Progress
from evoclaims.methods.flat_champion import no_episode
from evoclaims.methods.neat.settings import PAPER, Settings
from evoclaims.networks.activations import ACTIVATIONS
from evoclaims.networks.genome import Genome

INSTALL = 'pip install "tensorneat @ git+https://github.com/EMI-Group/tensorneat"'


@pytree
class Genes:
    """One of TensorNEAT's genomes; NaN where there is no gene.

    Attributes:
        nodes: rows (key, bias, response, aggregation, activation): inputs, outputs, then hidden nodes in any order.
        connections: rows (source key, target key, weight).
    """

    nodes: Float[Array, "nodes 5"]
    connections: Float[Array, "connections 3"]


@pytree
class TensorneatState:
    """TensorNEAT between two generations.

    Attributes:
        library: TensorNEAT's state as plain dictionaries, without its random key.
        level: the level of the last evaluation.
        champion: the best genome of the last evaluation; the newest of equals.
        episode: the champion's episode.
    """

    library: Mapping[str, Any]
    level: Int[Array, ""]
    champion: Genes
    episode: Episode


@dataclass(frozen=True)
class NeatTensorneat:
    """TensorNEAT's NEAT, with our hyperparameters."""

    name: ClassVar[str] = "neat_tensorneat"
    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ("tensorneat",)
    optional: ClassVar[bool] = True

    settings: Settings = PAPER

    def init(self, key: PRNGKeyArray, task: Task) -> TensorneatState:
        """Draw the first population; a `UserError` says when TensorNEAT is missing or the network does not fit."""
        algorithm, state = self._algorithm(task), library().common.State(randkey=jax.random.key_data(key))
        with implicit_promotions():
            made = strong(algorithm.setup(state))
            nodes, connections = algorithm.ask(made)
        return TensorneatState(
            library=_plain(made),
            level=jnp.zeros((), jnp.int32),
            champion=Genes(nodes=nodes[0], connections=connections[0]),
            episode=no_episode(),
        )

    def step(
        self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: TensorneatState
    ) -> tuple[TensorneatState, Progress]:
        """Evaluate the population on `level` and let TensorNEAT replace it by the next."""
        algorithm = self._algorithm(task)
        episode_key, reproduction_key = streams(key, "episode", "reproduction")
        now = _restored(state.library, reproduction_key)
        if self.settings.species.on_level_up == "reset":
            now = _without_records(now, level != state.level)
        genes = Genes(*algorithm.ask(now))
        keys = jax.random.split(episode_key, genes.nodes.shape[0])
        episodes = jax.vmap(lambda k, g: task.episode(_acting(algorithm, g), k, level))(keys, genes)
        fitness = jnp.where(jnp.isnan(episodes.fitness), -jnp.inf, episodes.fitness)
        best = fitness.shape[0] - 1 - jnp.argmax(fitness[::-1])
        champion, episode = jax.tree.map(lambda leaf: leaf[best], (genes, episodes))
        with implicit_promotions():
            following = strong(algorithm.tell(now, fitness))
        nodes, connections = _count(genes.nodes), _count(genes.connections)
        metrics = {
            "nodes": jnp.mean(nodes),
            "connections": jnp.mean(connections),
            "champion_nodes": nodes[best],
            "champion_connections": connections[best],
            "species": jnp.sum(~jnp.isnan(now.species.species_keys), dtype=jnp.int32).astype(jnp.float32),
        }
        progress = Progress(
            fitness=episode.fitness,
            success=episode.success,
            healthy=jnp.isfinite(episode.fitness) & _is_whole(champion),
            metrics=metrics,
        )
        return TensorneatState(library=_plain(following), level=level, champion=champion, episode=episode), progress

    def best(self, task: Task, state: TensorneatState) -> Policy:
        """Return the best genome of the last population that was evaluated; its parameters are the genome."""
        algorithm = self._algorithm(task)
        return Policy(parameters=state.champion, function=lambda genes, x: _acting(algorithm, genes)(x))

    def used(self, parameters: Genes) -> Any:
        """Return only the rows of nodes and of connections that hold a gene."""
        tables = np.asarray(parameters.nodes), np.asarray(parameters.connections)
        return [table[~np.isnan(table).all(axis=1)] for table in tables]

    def cost(self, task: Task) -> int:
        """Return the environment steps of one generation, at the longest episode."""
        return self.settings.population * task.horizon

    def _algorithm(self, task: Task) -> Any:
        return neat(self.settings, task.observation_size, task.action_size)


def library() -> Any:
    """Import TensorNEAT; a `UserError` gives the line that installs it."""
    try:
        # The first import may happen during tracing; its constants must not become part of the traced program.
        with warnings.catch_warnings(), jax.ensure_compile_time_eval():
            warnings.simplefilter("ignore")
            import tensorneat
    except ImportError as error:
        raise UserError(
            f"This method runs TensorNEAT, which cannot be imported ({error}). Install it with: {INSTALL}"
        ) from error
    return tensorneat


def neat(settings: Settings, inputs: int, outputs: int) -> Any:
    """Build TensorNEAT's NEAT for genomes with these inputs and outputs.

    Raises:
        UserError: when TensorNEAT is not installed or the smallest network does not fit.
    """
    settings.check_fits(inputs, outputs)
    tensorneat = library()
    parts, species, mutation = tensorneat.genome, settings.species, settings.mutation
    attributes = {
        f"{gene}_{name}": value
        for gene in ("bias", "response", "weight")
        for attribute in (getattr(mutation, gene),)
        for name, value in (
            ("init_mean", attribute.mean),
            ("init_std", attribute.std),
            ("mutate_power", attribute.power),
            ("mutate_rate", attribute.mutate_rate),
            ("replace_rate", attribute.replace_rate),
            ("lower_bound", -attribute.bound),
            ("upper_bound", attribute.bound),
        )
    }
    genome = parts.DefaultGenome(
        num_inputs=inputs,
        num_outputs=outputs,
        max_nodes=settings.nodes,
        max_conns=settings.connections,
        node_gene=parts.DefaultNode(
            **{name: value for name, value in attributes.items() if not name.startswith("weight")},
            activation_options=[ACTIVATIONS[name] for name in settings.activations],
            activation_replace_rate=mutation.activation_replace,
        ),
        conn_gene=parts.DefaultConn(**{name: value for name, value in attributes.items() if name.startswith("weight")}),
        mutation=parts.DefaultMutation(
            conn_add=mutation.connection_add,
            conn_delete=mutation.connection_delete,
            node_add=mutation.node_add,
            node_delete=mutation.node_delete,
        ),
        crossover=parts.DefaultCrossover(),
        distance=parts.DefaultDistance(
            compatibility_disjoint=species.disjoint, compatibility_weight=species.difference
        ),
        output_transform=ACTIVATIONS[settings.output],
    )
    return tensorneat.algorithm.NEAT(
        genome,
        pop_size=settings.population,
        species_size=species.most,
        max_stagnation=species.stagnation,
        species_elitism=species.exempt,
        spawn_number_change_rate=species.change,
        genome_elitism=species.elites,
        survival_threshold=species.survival,
        compatibility_threshold=species.threshold,
    )


def _acting(algorithm: Any, genes: Genes) -> PolicyFn:
    """Bind a genome to TensorNEAT's forward pass; an output of NaN is read as 0."""
    stateless = library().common.State()
    with implicit_promotions():
        network = algorithm.transform(stateless, (genes.nodes, genes.connections))

    def act(observation: Float[Array, " observation"]) -> Float[Array, " action"]:
        with implicit_promotions():
            action = algorithm.forward(stateless, network, observation)
        return jnp.where(jnp.isnan(action), 0.0, action)

    return act


def _plain(state: Any) -> dict[str, Any]:
    """Turn TensorNEAT's state into dictionaries, without its key."""
    return {
        name: _plain(value) if isinstance(value, type(state)) else value
        for name, value in state.state_dict.items()
        if name != "randkey"
    }


def _restored(plain: Mapping[str, Any], key: PRNGKeyArray) -> Any:
    """Turn dictionaries back into TensorNEAT's state, with `key` as its random key."""
    State = library().common.State

    def restore(value: Any) -> Any:
        return State(**{name: restore(part) for name, part in value.items()}) if isinstance(value, Mapping) else value

    return restore(plain).register(randkey=jax.random.key_data(key))


def _without_records(state: Any, forget: Bool[Array, ""]) -> Any:
    """If `forget`, let every species count as improved in the next generation, as ours does on a new level."""
    best = state.species.best_fitness
    forgotten = jnp.where(forget & ~jnp.isnan(best), -jnp.inf, best)
    return state.update(species=state.species.update(best_fitness=forgotten))


def _count(genes: Float[Array, "population rows columns"]) -> Float[Array, " population"]:
    return jnp.sum(~jnp.isnan(genes[:, :, 0]), axis=1, dtype=jnp.int32).astype(jnp.float32)


def _is_whole(genes: Genes) -> Bool[Array, ""]:
    """Whether there are nodes, and no node is partly NaN."""
    missing = jnp.isnan(genes.nodes)
    absent = jnp.all(missing, axis=1)
    return ~jnp.all(absent) & jnp.all(jnp.any(missing, axis=1) == absent)


def translated(genome: Genome) -> Genes:
    """Translate one of our genomes to TensorNEAT's format, where keys from 2²⁴ on are not exact, to compare the two."""
    nodes, genes = genome.nodes, genome.connections
    absent = np.iinfo(np.int32).max
    # Sorting by key puts inputs first, then outputs, then hidden nodes.
    order = jnp.argsort(jnp.where(genome.has_node, nodes.key, absent), stable=True)
    columns = (nodes.key, nodes.bias, nodes.response, jnp.zeros_like(nodes.bias), nodes.activation)
    rows = jnp.stack([column.astype(jnp.float32) for column in columns], axis=1)
    links = (nodes.key[genes.source], nodes.key[genes.target], genes.weight)
    linked = jnp.stack([column.astype(jnp.float32) for column in links], axis=1)
    return Genes(
        nodes=jnp.where(genome.has_node[:, None], rows, jnp.nan)[order],
        connections=jnp.where(genome.has_connection[:, None], linked, jnp.nan),
    )
