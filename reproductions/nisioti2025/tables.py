"""The tables of hyperparameters (appendix A), with the values of each tier."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from evoclaims import Condition
from evoclaims.figures import Block, Figure, Listing
from evoclaims.networks import AllSkips, Mlp
from reproductions.nisioti2025.figures import PUBLISHED

Settings = Mapping[str, Callable[[Condition], Any]]


def _length(condition: Condition) -> str:
    """Return the training length, which the paper omits."""
    budget = condition.budget
    if budget.generations is not None:
        return f"{budget.generations:,} generations"
    return f"{budget.environment_steps:,} environment steps"


def _encoding(network: AllSkips | Mlp) -> str:
    """Return the network that CMA-ES trains: the paper's, or the perceptron of smoke's gates."""
    if isinstance(network, AllSkips):
        return f"{network.hidden} hidden neurons, all skip connections"
    return _layers(network.layers)


def _layers(widths: tuple[int, ...]) -> str:
    """Return a network's hidden layers in words."""
    return f"{len(widths)} layers of {widths[0]} neurons" if len(set(widths)) == 1 else f"layers of {widths} neurons"


def _centroids(condition: Condition) -> str:
    """Return the grid of MAP-Elites."""
    across, up = condition.method.cells
    return f"{across}-by-{up} Euclidean grid"


NEAT: Settings = {
    "population size": lambda c: c.method.settings.population,
    "number of species": lambda c: c.method.settings.species.most,
    "add connection probability": lambda c: c.method.settings.mutation.connection_add,
    "delete connection probability": lambda c: c.method.settings.mutation.connection_delete,
    "mutation connection": lambda c: c.method.settings.mutation.weight.mutate_rate,
    "mutation node": lambda c: c.method.settings.mutation.bias.mutate_rate,
    "node deletion probability": lambda c: c.method.settings.mutation.node_delete,
    "add node probability": lambda c: c.method.settings.mutation.node_add,
    "architecture": lambda c: "feedforward",  # genomes here are always feedforward
    "most nodes, connections": lambda c: f"{c.method.settings.nodes}, {c.method.settings.connections}",
    "training length": _length,
}
SUBSTRATE: Settings = {
    **NEAT,
    "functions of the CPPN": lambda c: ", ".join(c.method.settings.activations),
    "hidden neurons of the substrate": lambda c: _hidden(c.method),
}
SHORT = ("population size", "number of species", "most nodes, connections", "training length")
PPO: Settings = {
    "architecture": lambda c: _layers(c.method.policy_layers),
    "architecture of the value network": lambda c: _layers(c.method.value_layers),
    "number of updates per batch": lambda c: c.method.updates_per_batch,
    "discounting": lambda c: c.method.discounting,
    "learning rate": lambda c: c.method.learning_rate,
    "number of minibatches": lambda c: c.method.minibatches,
    "batch size": lambda c: c.method.batch_size,
    "entropy cost": lambda c: c.method.entropy_cost,
    "reward scaling": lambda c: c.method.reward_scaling,
    "unroll length": lambda c: c.method.unroll_length,
    "environments": lambda c: c.method.environments,
    "training length": _length,
}
CMA_ES: Settings = {
    "architecture": lambda c: _encoding(c.method.network),
    "population size": lambda c: c.method.population,
    "training length": _length,
}
MAP_ELITES: Settings = {
    "architecture": lambda c: _layers(c.method.network.layers),
    "number of loops": lambda c: c.budget.reports,
    "number of iterations": lambda c: c.budget.generations,
    "batch size": lambda c: c.method.batch,
    "centroids": _centroids,
}


def _hidden(method: Any) -> int:
    """Return the hidden neurons of HyperNEAT's substrate."""
    return sum(method.hidden if method.substrate is None else map(len, method.substrate.layers[1:-1]))


def _only(settings: Settings, *names: str) -> Settings:
    """Return some of the settings."""
    return {name: settings[name] for name in names}


FIGURE = Figure(
    name="tables",
    title="Hyperparameters",
    where="appendix A",
    paint=Listing(
        blocks=(
            Block("NEAT, stepping gates", "neat", "n_parity", "neat", NEAT),
            Block("NEAT, ecorobot", "neat", "stones", "neat_ecorobot", _only(NEAT, *SHORT)),
            Block("HyperNEAT, stepping gates", "hyperneat", "n_parity", "hyperneat", SUBSTRATE),
            Block(
                "HyperNEAT, ecorobot",
                "hyperneat",
                "stones",
                "hyperneat_ecorobot",
                _only(SUBSTRATE, *SHORT, "hidden neurons of the substrate"),
            ),
            Block("CMA-ES, stepping gates", "cma_es", "n_parity", "cma_es", CMA_ES),
            Block("CMA-ES, ecorobot", "cma_es", "stones", "cma_es", CMA_ES),
            Block("PPO, stepping gates", "ppo", "n_parity", "ppo", PPO),
            Block("PPO, ecorobot", "ppo", "stones", "ppo_ecorobot", PPO),
            Block("MAP-Elites, ecorobot", "map_elites", "stones", "map_elites", MAP_ELITES),
        ),
        published=PUBLISHED,
        remarks=(
            "Ours are read from the conditions on N-parity and on the maze with stepping stones.",
            "The paper's batch size of PPO, 20,498, is a misprint of 2,048, the published code's.",
            "The paper's loops of MAP-Elites are read as the reports that training is cut into (docs/protocol.md).",
        ),
    ),
)
