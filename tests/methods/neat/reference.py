"""NEAT once more, as sentences about dicts of genes in float64: what the arrays are compared with.

Nothing is shared with the package but the names of activation functions.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

Row = NDArray[np.float64]
FUNCTIONS: Mapping[str, Callable[[Row], Row]] = {
    "tanh": np.tanh,
    "sigmoid": lambda z: 1.0 / (1.0 + np.exp(-z)),
    "sin": np.sin,
    "gauss": lambda z: np.exp(-np.square(z)),
    "abs": np.abs,
    "identity": lambda z: z,
}


@dataclass(frozen=True)
class Node:
    bias: float = 0.0
    response: float = 1.0
    activation: int = 0


@dataclass(frozen=True)
class Genes:
    """A genome: nodes by key, weights by the keys of both ends."""

    nodes: Mapping[int, Node]
    connections: Mapping[tuple[int, int], float] = field(default_factory=dict)


def forward(genes: Genes, rows: Row, outputs: int, activations: Sequence[str] = ("tanh",), output: str = "tanh") -> Row:
    """Return the readings [rows, outputs]; NaN stands for what is not emitted."""
    inputs = rows.shape[1]
    emitted: dict[int, Row] = {key: rows[:, key] for key in range(inputs)}

    def emit(key: int) -> Row:
        if key not in emitted:
            node = genes.nodes[key]
            arriving = [weight * emit(s) for (s, t), weight in sorted(genes.connections.items()) if t == key]
            stacked = np.array([np.full(len(rows), np.nan), *arriving])
            z = node.bias + node.response * np.nansum(stacked, axis=0)
            is_output = inputs <= key < inputs + outputs
            value = z if is_output else FUNCTIONS[activations[node.activation]](z)
            emitted[key] = np.where(np.isnan(stacked).all(axis=0), np.nan, value)
        return emitted[key]

    readings = np.array([FUNCTIONS[output](emit(inputs + o)) for o in range(outputs)]).T
    return np.where(np.isnan(readings), 0.0, readings)


def distance(one: Genes, other: Genes, disjoint: float = 1.0, difference: float = 0.4) -> float:
    """Return the nodes' distance plus the connections'."""
    shared_nodes = one.nodes.keys() & other.nodes.keys()
    apart = 0.0
    for key in shared_nodes:
        a, b = one.nodes[key], other.nodes[key]
        apart += abs(a.bias - b.bias) + abs(a.response - b.response) + (a.activation != b.activation)
    shared_connections = one.connections.keys() & other.connections.keys()
    stretch = sum(abs(one.connections[ends] - other.connections[ends]) for ends in shared_connections)

    def part(shared: int, apart: float, n: int, m: int) -> float:
        return (disjoint * (n + m - 2 * shared) + difference * apart) / max(n, m) if max(n, m) else 0.0

    return part(len(shared_nodes), apart, len(one.nodes), len(other.nodes)) + part(
        len(shared_connections), stretch, len(one.connections), len(other.connections)
    )


def speciate(
    centres: Sequence[Genes], population: Sequence[Genes], most: int, threshold: float
) -> tuple[list[int], list[int]]:
    """Return the species of each genome, and the genome that is the centre of each species."""
    species_of: dict[int, int] = {}
    new_centres: list[int] = []
    for species, old in enumerate(centres):
        free = [i for i in range(len(population)) if i not in species_of]
        nearest = min(free, key=lambda i: distance(old, population[i]))
        species_of[nearest] = species
        new_centres.append(nearest)
    apart = dict.fromkeys(species_of, 0.0)

    def attract(species: int) -> None:
        for i, genome in enumerate(population):
            d = distance(population[new_centres[species]], genome)
            if d < threshold and (i not in species_of or d < apart[i]):
                species_of[i], apart[i] = species, d

    for species in range(len(centres)):
        attract(species)
    while len(species_of) < len(population) and len(new_centres) < most:
        founder = min(i for i in range(len(population)) if i not in species_of)
        species_of[founder], apart[founder] = len(new_centres), 0.0
        new_centres.append(founder)
        attract(species_of[founder])
    return [species_of.get(i, most - 1) for i in range(len(population))], new_centres


@dataclass(frozen=True)
class Record:
    """A species: the best fitness it has had, when it had it, and its members."""

    best: float
    improved_at: int
    members: tuple[int, ...]


def survive(
    species: Mapping[int, Record], fitness: Sequence[float], generation: int, stagnation: int, exempt: int
) -> dict[int, Record]:
    """Return the species that survive under their old places, the best first."""
    top = {place: max(fitness[i] for i in record.members) for place, record in species.items()}
    improved = {place: top[place] > record.best for place, record in species.items()}
    safe = sorted(species, key=lambda place: (-top[place], place))[:exempt]
    survivors = {}
    for place in sorted(species, key=lambda place: (-top[place], -place)):
        record = species[place]
        if improved[place]:
            survivors[place] = Record(top[place], generation, record.members)
        elif generation - record.improved_at <= stagnation or place in safe:
            survivors[place] = record
    return survivors


def offspring(sizes: Sequence[int], population: int, change: float = 0.5) -> list[int]:
    """Return how many members each species gets; the species are in order, the best first."""
    count, alive = [], len(sizes)
    for i, size in enumerate(sizes):
        aim = math.floor(Fraction(2 * population * (alive - i), alive * (alive + 1)))
        count.append(max(math.floor(size + Fraction(change) * (aim - size)), 1))
    count[0] += population - sum(count)
    return count


def ranked(members: Sequence[int], fitness: Sequence[float]) -> list[int]:
    """Return members of a species, the fittest first, and of equals the newest."""
    return sorted(members, key=lambda i: (-fitness[i], -i))


def pool(members: Sequence[int], fitness: Sequence[float], survival: float) -> list[int]:
    """Return the members that may become parents."""
    return ranked(members, fitness)[: max(1, math.floor(np.float32(survival) * np.float32(len(members))))]
