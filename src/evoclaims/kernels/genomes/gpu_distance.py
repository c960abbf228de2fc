"""The distances of genomes to some others as a kernel for GPUs: a thread compares one genome with one other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from evoclaims.kernels.emit.control import at, load, repeat, store, when
from evoclaims.kernels.emit.group_kernel import Rows
from evoclaims.kernels.emit.llvm_ir import Instructions, literal
from evoclaims.kernels.genomes.homology import NAN, find, is_place

INFINITY: Final = str(0x7F800000)
"""The bits of a float32."""
ZERO: Final = literal(np.float32(0))


@dataclass(frozen=True)
class Comparison:
    """What is compared.

    Attributes:
        disjoint, difference: weights in the distance (`Species`).
        population: genomes that are compared.
        by_gene: whether their leaves are [genes, population], so that the threads of a warp read neighbours.
        nodes, connections: capacities.
        step: keys that are compared at a time; lists of a centre's keys have a multiple of it.
    """

    disjoint: float
    difference: float
    population: int
    by_gene: bool
    nodes: int
    connections: int
    step: int

    @property
    def keys(self) -> int:
        """The length of a list of keys."""
        return self.nodes + -self.nodes % self.step

    def write(self, rows: Rows, groups: Sequence[str], row: Sequence[str], results: Sequence[str]) -> None:
        """Write the distances of genomes to centres, inf to those that do not count.

        Args:
            rows: pairs of a centre and a genome.
            groups: addresses of the population's leaves; of the centres' keys, biases, responses, activations, weights
                between slots, [target, source] with NaN for none, and counts; and of how many centres count.
            row: of the first pair's number, centre by centre.
            results: of its distance, or inf.
        """
        page, count = rows.page, load(rows.page, groups[16])
        slots = page.allocate("i32", self.nodes, 4)

        def measure(at_row: str) -> list[str]:
            pair = load(page, row[0], at_row)
            place, genome = (page.put(f"{name} i32 {pair}, {self.population}") for name in ("udiv", "urem"))
            inside = page.put(f"icmp slt i32 {place}, {count}")
            distance = when(page, inside, "i32", _Pair(self, page, slots, groups, place, genome).distance, INFINITY)
            store(page, distance, results[0], at_row)
            return []

        repeat(page, "0", rows.count, [], measure)


class _Pair:
    """A genome and a centre."""

    def __init__(
        self, of: Comparison, page: Instructions, slots: str, groups: Sequence[str], place: str, genome: str
    ) -> None:
        """Find the leaves; `slots` is room for the centre's slot of each node."""
        self.of, self.page, self.slots = of, page, slots
        sizes = [1] * 9 if of.by_gene else [*[of.nodes] * 4, *[of.connections] * 3, 1, 1]
        self.own = self._rows(groups[:9], genome, sizes)
        self.centre = self._rows(groups[9:16], place, [of.keys, *[of.nodes] * 3, of.nodes**2, 1, 1])

    def distance(self) -> str:
        """Return the bits of the distance."""
        page, (key, bias, response, activation, source, target, weight, nodes, connections) = self.page, self.own
        keys, biases, responses, activations, weights, their_nodes, their_connections = self.centre
        node_count, connection_count = self._own(nodes, "0"), self._own(connections, "0")
        other_nodes, other_connections = load(page, their_nodes), load(page, their_connections)

        def node(slot: str, total: str, shared: str) -> list[str]:
            found = find(page, keys, self._own(key, slot), other_nodes, self.of.step)
            store(page, found, self.slots, slot)

            def differences() -> str:
                of_genome = [self._own(each, slot) for each in (bias, response, activation)]
                of_centre = [load(page, each, found) for each in (biases, responses, activations)]
                *apart, functions = zip(of_genome, of_centre, strict=True)
                differs = page.put(f"uitofp i1 {page.put('icmp ne i32 {}, {}'.format(*functions))} to float")
                return self._float("fadd", self._float("fadd", *(self._apart(*each) for each in apart)), differs)

            there = is_place(page, found)
            return self._more(total, shared, there, when(page, there, "float", differences, ZERO))

        def connection(place: str, total: str, shared: str) -> list[str]:
            begin, end = (load(page, self.slots, self._own(ends, place)) for ends in (source, target))

            def look_up() -> str:
                return load(page, weights, page.put(f"add i32 {page.put(f'mul i32 {end}, {self.of.nodes}')}, {begin}"))

            other = when(page, is_place(page, page.put(f"or i32 {begin}, {end}")), "i32", look_up, NAN)
            there = page.put(f"fcmp ord float {self._as_float(other)}, {ZERO}")
            apart = when(page, there, "float", lambda: self._apart(self._own(weight, place), other), ZERO)
            return self._more(total, shared, there, apart)

        none = [("float", ZERO), ("i32", "0")]
        total, shared = repeat(page, "0", node_count, none, node)
        of_nodes = self._part(total, shared, node_count, other_nodes)
        total, shared = repeat(page, "0", connection_count, none, connection)
        of_connections = self._part(total, shared, connection_count, other_connections)
        return page.put(f"bitcast float {self._float('fadd', of_nodes, of_connections)} to i32")

    def _own(self, array: str, gene: str) -> str:
        """Return a number of the genome."""
        return load(self.page, array, self.page.put(f"mul i32 {gene}, {self.of.population if self.of.by_gene else 1}"))

    def _rows(self, arrays: Sequence[str], number: str, sizes: Sequence[int]) -> list[str]:
        """Return the addresses of a row of each array."""
        starts = [self.page.put(f"mul i32 {number}, {size}") for size in sizes]
        return [at(self.page, array, start) for array, start in zip(arrays, starts, strict=True)]

    def _apart(self, one: str, other: str) -> str:
        """Return by how much two numbers differ, given their bits."""
        apart = self._float("fsub", self._as_float(one), self._as_float(other))
        return self.page.call("llvm.fabs.f32", "float", [("float", apart)])

    def _as_float(self, bits: str) -> str:
        return self.page.put(f"bitcast i32 {bits} to float")

    def _more(self, total: str, shared: str, there: str, apart: str) -> list[str]:
        """Add a gene to the sum of differences and to the number of homologous genes."""
        one = self.page.put(f"zext i1 {there} to i32")
        return [self._float("fadd", total, apart), self.page.put(f"add i32 {shared}, {one}")]

    def _part(self, total: str, shared: str, count: str, other_count: str) -> str:
        """Return the part of the distance that nodes or connections make up."""
        page = self.page
        alone = page.put(f"sub i32 {page.put(f'add i32 {count}, {other_count}')}, {page.put(f'shl i32 {shared}, 1')}")
        most = count
        for other in (other_count, "1"):
            most = page.call("llvm.smax.i32", "i32", [("i32", most), ("i32", other)])
        disjoint, divisor = (page.put(f"sitofp i32 {each} to float") for each in (alone, most))
        weights = (literal(np.float32(weight)) for weight in (self.of.disjoint, self.of.difference))
        parts = [self._float("fmul", *each) for each in zip(weights, (disjoint, total), strict=True)]
        return page.divided(self._float("fadd", *parts), divisor)

    def _float(self, name: str, one: str, other: str) -> str:
        return self.page.put(f"{name} float {one}, {other}")
