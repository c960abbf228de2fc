"""NEAT's hyperparameters, as frozen records with the paper's values as defaults.

"TensorNEAT" marks defaults of the library that the paper used (Wang et al. 2024) and did not change.
"""

from __future__ import annotations

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
        if self.std < 0 or self.power < 0 or self.bound <= 0:
            raise UserError(
                "An attribute's spread and noise are 0 or more and its bound is above 0, not "
                f"{self.std}, {self.power} and {self.bound}."
            )
        if self.mutate_rate < 0 or self.replace_rate < 0 or self.mutate_rate + self.replace_rate > 1:
            raise UserError(
                f"The rates of mutation and replacement are {self.mutate_rate} and {self.replace_rate}. "
                "They must be probabilities whose sum is at most 1."
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
            if isinstance(value, float) and not 0 <= value <= 1:
                raise UserError(f"The probability of {field.name} is {value}. It must be between 0 and 1.")


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
                "Of a species a share in (0, 1] survives, it changes by a share in [0, 1], and its threshold is above "
                f"0: not {self.survival}, {self.change} and {self.threshold}."
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
            raise UserError("NEAT needs at least one activation function.")
        if self.population < 2 * self.species.most:
            raise UserError(
                f"A population of {self.population} is too small for {self.species.most} species: it needs at least "
                f"{2 * self.species.most} genomes."
            )

    def check_fits(self, inputs: int, outputs: int) -> None:
        """Raise a `UserError` when the smallest network does not fit."""
        if self.nodes < inputs + outputs or self.connections < inputs * outputs:
            raise UserError(
                f"A network of {inputs} inputs and {outputs} outputs starts with {inputs + outputs} nodes and "
                f"{inputs * outputs} connections; at most {self.nodes} and {self.connections} are allowed."
            )


PAPER = Settings()
