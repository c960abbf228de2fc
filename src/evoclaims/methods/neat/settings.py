"""NEAT's hyperparameters, as frozen records with the paper's values as defaults.

"TensorNEAT" marks defaults of the library that the paper used (Wang et al. 2024) and did not change.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Literal, get_args

from evoclaims.core.errors import UserError, require_at_least, require_known
from evoclaims.networks.activations import check_activations

LevelUp = Literal["reset", "keep"]


@dataclass(frozen=True)
class Attribute:
    """How one real-valued attribute of a gene is drawn and mutated (TensorNEAT).

    Attributes:
        mean, std: of the normal distribution for initial values and replacements.
        power: standard deviation of the noise that a mutation adds.
        mutate_rate, replace_rate: probabilities of noise and of a new draw; they exclude each other.
        bound: values are clipped to ± this.
    """

    mean: float = 0.0
    std: float = 1.0
    power: float = 0.15
    mutate_rate: float = 0.1  # paper, Table "Hyperparameters for NEAT": mutation node, mutation connection
    replace_rate: float = 0.015
    bound: float = 5.0

    def __post_init__(self) -> None:
        """Check the probabilities and sizes."""
        if not (0 <= self.std < math.inf and 0 <= self.power < math.inf and self.bound > 0):
            raise UserError(
                f"An attribute has std={self.std}, power={self.power} and bound={self.bound}. Write a finite std and "
                "power of at least 0, and a bound above 0."
            )
        if self.mutate_rate < 0 or self.replace_rate < 0 or self.mutate_rate + self.replace_rate > 1:
            raise UserError(
                f"An attribute has mutate_rate={self.mutate_rate} and replace_rate={self.replace_rate}. Write "
                "probabilities whose sum is at most 1."
            )


@dataclass(frozen=True)
class Mutation:
    """Probabilities of the structural mutations, and the mutation of values (paper's table)."""

    node_add: float = 0.2
    node_delete: float = 0.1
    connection_add: float = 0.2
    connection_delete: float = 0.2
    bias: Attribute = Attribute()
    response: Attribute = Attribute(mean=1.0, std=0.0)
    weight: Attribute = Attribute()
    activation_replace: float = 0.1  # TensorNEAT

    def __post_init__(self) -> None:
        """Check the probabilities."""
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, int | float) and not 0 <= value <= 1:
                raise UserError(f"A probability of NEAT is {field.name}={value}. Write a number from 0 to 1.")


@dataclass(frozen=True)
class Species:
    """How genomes are compared, grouped and given offspring (TensorNEAT, with the paper's numbers).

    Attributes:
        most: maximum number of species.
        threshold: a genome joins a species whose centre is nearer than this.
        disjoint, difference: weights in the distance: per gene without a counterpart, and per unit of difference in
            an attribute of homologous genes.
        stagnation: generations without improvement after which a species dies.
        exempt: number of best species that never die.
        on_level_up: "reset" forgets all improvements when the task's level changes, since fitness is not comparable
            across levels; "keep" is TensorNEAT's behaviour: all species that are not exempt may then die.
        elites: number of best members of each species that are kept unchanged.
        survival: share of a species' members, the best, that become parents; at least one.
        change: share of the way from a species' size to the target size of its rank, moved in one generation.
    """

    most: int = 50  # paper's table
    threshold: float = 2.0
    disjoint: float = 1.0
    difference: float = 0.4
    stagnation: int = 15
    exempt: int = 2
    on_level_up: LevelUp = "reset"
    elites: int = 2
    survival: float = 0.01  # published code
    change: float = 0.5

    def __post_init__(self) -> None:
        """Check the names and sizes."""
        require_known("treatment of stagnation on a new level", self.on_level_up, get_args(LevelUp))
        require_at_least(1, "NEAT's", most=self.most, exempt=self.exempt)
        require_at_least(0, "NEAT's", stagnation=self.stagnation, elites=self.elites)
        if not (0 < self.survival <= 1 and 0 <= self.change <= 1 and self.threshold > 0):
            raise UserError(
                f"NEAT's species have survival={self.survival}, change={self.change} and threshold={self.threshold}. "
                "Write a survival above 0 and at most 1, a change from 0 to 1, and a threshold above 0."
            )
        if not (0 <= self.disjoint < math.inf and 0 <= self.difference < math.inf):
            raise UserError(
                f"NEAT's species have disjoint={self.disjoint} and difference={self.difference}. Write finite "
                "weights of at least 0."
            )


@dataclass(frozen=True)
class Settings:
    """All hyperparameters of NEAT.

    Attributes:
        population: number of genomes.
        nodes, connections: maximum numbers per genome.
        activations: the set that hidden nodes' activation functions are drawn from; a new node has the first.
        output: activation function of the output nodes.
    """

    population: int = 5_000  # paper's table
    nodes: int = 100
    connections: int = 400
    activations: tuple[str, ...] = ("tanh",)
    output: str = "tanh"
    mutation: Mutation = Mutation()
    species: Species = Species()

    def __post_init__(self) -> None:
        """Check names and sizes."""
        check_activations((*self.activations, self.output))
        if not self.activations:
            raise UserError(f'NEAT has activations={self.activations}. Write at least one, such as ("tanh",).')
        if self.population < 2 * self.species.most:
            raise UserError(
                f"NEAT has population={self.population}, too few for {self.species.most} species. Write at least "
                f"{2 * self.species.most}, or allow fewer species (most)."
            )

    def check_fits(self, inputs: int, outputs: int) -> None:
        """Raise a `UserError` when the smallest network does not fit."""
        if self.nodes < inputs + outputs or self.connections < inputs * outputs:
            raise UserError(
                f"A network of {inputs} inputs and {outputs} outputs starts with {inputs + outputs} nodes and "
                f"{inputs * outputs} connections, but nodes={self.nodes} and connections={self.connections} are the "
                "most allowed. Write larger ones."
            )


PAPER = Settings()
