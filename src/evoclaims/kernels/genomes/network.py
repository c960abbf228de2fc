"""The forward pass of a genome's network as a kernel: a walk through the connections that the genome has.

On processors the lanes are observations of one genome; on a GPU a thread is one observation. The values of nodes lie in
the processor's cache, or in the thread's memory; NaN there means that the node emits nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import jax
import jax.numpy as jnp
from jaxtyping import Array

from evoclaims.kernels.call.grouped import GroupKernel
from evoclaims.kernels.emit.control import choose, load, repeat, store, when
from evoclaims.kernels.emit.group_kernel import Rows
from evoclaims.kernels.trace.expressions import Expression, in_order
from evoclaims.kernels.trace.scalarize import scalarize

NOTHING, INFINITE, ZERO = "0x7FF8000000000000", "0x7FF0000000000000", "0x0000000000000000"
"""NaN, infinity and 0 in LLVM's text."""
ALIGNMENT: Final = 64
"""Bytes of the widest vector register."""
NUMBER: Final = jax.ShapeDtypeStruct((), jnp.float32)


@dataclass(frozen=True)
class Functions:
    """What nodes compute of their z, each an expression of one input.

    Attributes:
        nodes: those that nodes index, the outputs' last.
        output: what is read of an output.
    """

    nodes: tuple[Expression, ...]
    output: Expression


def network_kernel(
    inputs: int,
    outputs: int,
    activations: Sequence[Callable[[Array], Array]],
    output: Callable[[Array], Array],
    capacity: tuple[int, int],
    function: Callable[..., Sequence[Array]],
) -> GroupKernel:
    """Return the kernel for networks of a capacity (nodes, connections).

    Its arguments are the leaves of a `Wiring` and one observation; `function` is the same in jax. A node computes the
    activation that it indexes; the last one is that of outputs, of which `output` is then read.
    """
    nodes, connections = capacity
    functions = Functions(tuple(map(_expression, activations)), _expression(output))

    def write(rows: Rows, groups: Sequence[str], given: Sequence[str], results: Sequence[str]) -> None:
        _Walk(rows, nodes, functions, groups).write(inputs, outputs, given[0], results[0])

    numbers, whole = partial(_array, jnp.float32), partial(_array, jnp.int32)
    of_connections = whole(connections), numbers(connections)
    of_nodes = whole(nodes), numbers(nodes), numbers(nodes), whole(nodes)
    return GroupKernel(
        name="The forward pass of genomes",
        function=function,
        groups=(*of_connections, *of_nodes, whole(outputs), whole()),
        rows=(numbers(inputs),),
        outputs=(numbers(outputs),),
        write=write,
    )


def _array(dtype: Any, *shape: int) -> jax.ShapeDtypeStruct:
    return jax.ShapeDtypeStruct(shape, dtype)


def _expression(function: Callable[[Array], Array]) -> Expression:
    (result,) = scalarize(jax.make_jaxpr(function)(NUMBER))
    number: Any = result[()]
    assert isinstance(number, Expression)
    return number


class _Walk:
    """Writes the walk through one genome's connections, for some rows."""

    def __init__(self, rows: Rows, nodes: int, functions: Functions, groups: Sequence[str]) -> None:
        """Make room for the values of `nodes` nodes; `groups` are the addresses of a `Wiring`'s arrays."""
        self.rows, self.page, self.functions = rows, rows.page, functions
        self.source, self.weight, self.ends, self.bias, self.response, self.activation, self.slots, self.count = groups
        self.floats, self.bits = self.page.vector("float"), self.page.vector("i1")
        self.alignment = min(4 * self.page.lanes, ALIGNMENT)
        self.values = self.page.allocate(self.floats, nodes, self.alignment)
        self.nothing, self.zero = self.page.splat("float", NOTHING), self.page.splat("float", ZERO)

    def write(self, inputs: int, outputs: int, observation: str, result: str) -> None:
        """Write everything: the inputs' values, the other nodes', and what the outputs say."""
        page = self.page
        for place in range(inputs):
            given = self.rows.load(observation, inputs, place)
            self._keep(str(place), self._chosen(self._is_finite(given), given, self.nothing))
        count = page.put(f"load i32, ptr {self.count}, align 4")
        repeat(page, str(inputs), count, [("i32", "0")], self._node)
        for place in range(outputs):
            value = self._kept(self._number("i32", self.slots, str(place)))
            emits = self._emits(value)
            reading = self._apply(self.functions.output, self._chosen(emits, value, self.zero))
            self.rows.store(result, outputs, place, self._chosen(emits, reading, self.zero))

    def _node(self, slot: str, begin: str) -> list[str]:
        """Write a node's value, given where its connections begin; return where they end."""
        end = self._number("i32", self.ends, slot)
        fed = self.page.put(f"icmp slt i32 {begin}, {end}")
        value = when(self.page, fed, self.floats, lambda: self._fed(slot, begin, end), self.nothing)
        self._keep(slot, value)
        return [end]

    def _fed(self, slot: str, begin: str, end: str) -> str:
        """Return the value of a node that has connections."""
        page = self.page
        start = [(self.floats, self.zero), (self.bits, page.splat("i1", "false"))]
        received, fed = repeat(page, begin, end, start, self._receive)
        bias, response = (
            page.in_all_lanes("float", self._number("float", array, slot)) for array in (self.bias, self.response)
        )
        z = self._sum(response, received, bias)
        cases = [partial(self._apply, function, z) for function in self.functions.nodes]
        value = choose(page, self._number("i32", self.activation, slot), self.floats, cases)
        return self._chosen(fed, self._chosen(self._is_finite(value), value, self.zero), self.nothing)

    def _receive(self, connection: str, received: str, fed: str) -> list[str]:
        """Add what comes through a connection; return the sum, and whether anything came."""
        page = self.page
        value = self._kept(self._number("i32", self.source, connection))
        weight = page.in_all_lanes("float", self._number("float", self.weight, connection))
        emits = self._emits(value)
        total = self._sum(weight, self._chosen(emits, value, self.zero), received)
        return [total, page.put(f"or {self.bits} {fed}, {emits}")]

    def _apply(self, function: Expression, z: str) -> str:
        """Write an activation function; return its value."""
        registers: dict[int, Any] = {}
        self.page.compute(in_order([function]), registers, lambda _: z)
        return self.page.operand(function, registers)

    def _sum(self, a: str, b: str, c: str) -> str:
        return self.page.call(self.page.mangled("fma", "f32"), self.floats, [(self.floats, each) for each in (a, b, c)])

    def _emits(self, value: str) -> str:
        return self.page.put(f"fcmp ord {self.floats} {value}, {self.zero}")

    def _is_finite(self, value: str) -> str:
        size = self.page.call(self.page.mangled("fabs", "f32"), self.floats, [(self.floats, value)])
        return self.page.put(f"fcmp olt {self.floats} {size}, {self.page.splat('float', INFINITE)}")

    def _chosen(self, condition: str, yes: str, no: str) -> str:
        return self.page.put(f"select {self.bits} {condition}, {self.floats} {yes}, {self.floats} {no}")

    def _number(self, type_: str, array: str, place: str) -> str:
        where = self.page.put(f"getelementptr {type_}, ptr {array}, i32 {place}")
        return self.page.put(f"load {type_}, ptr {where}, align 4")

    def _kept(self, slot: str) -> str:
        where = self.page.put(f"getelementptr {self.floats}, ptr {self.values}, i32 {slot}")
        return self.page.put(f"load {self.floats}, ptr {where}, align {self.alignment}")

    def _keep(self, slot: str, value: str) -> None:
        where = self.page.put(f"getelementptr {self.floats}, ptr {self.values}, i32 {slot}")
        self.page.write(f"store {self.floats} {value}, ptr {where}, align {self.alignment}")


def sorting_kernel(nodes: int, connections: int, function: Callable[..., Sequence[Array]]) -> GroupKernel:
    """Return the kernel that sorts a genome's connections, given capacities.

    Its arguments are the connections' sources, targets and weights, and their number. Its results are the sorted
    sources and weights, and for each slot the number of connections that lead to it or to a lower one. `function` is
    the same in jax.
    """
    numbers, whole = jax.ShapeDtypeStruct((connections,), jnp.float32), jax.ShapeDtypeStruct((connections,), jnp.int32)
    ends, one = jax.ShapeDtypeStruct((nodes,), jnp.int32), jax.ShapeDtypeStruct((), jnp.int32)

    def write(lanes: Rows, groups: Sequence[str], rows: Sequence[str], results: Sequence[str]) -> None:
        _write(lanes, nodes, connections, groups, results)

    return GroupKernel(
        name="The forward pass of genomes",
        function=function,
        groups=(whole, whole, numbers, one),
        rows=(),
        outputs=(whole, numbers, ends),
        write=write,
    )


def _write(lanes: Rows, nodes: int, connections: int, groups: Sequence[str], results: Sequence[str]) -> None:
    """Write the same as a counting sort; `ends` is first the number of each slot's connections, then where they are."""
    page = lanes.page
    source, target, weight, count_at = groups
    sorted_source, sorted_weight, ends = results
    places = page.allocate("i32", nodes, 4)
    count = page.put(f"load i32, ptr {count_at}, align 4")

    def clear(slot: str) -> list[str]:
        store(page, "0", places, slot)
        return []

    def tally(connection: str) -> list[str]:
        slot = load(page, target, connection)
        store(page, page.put(f"add i32 {load(page, places, slot)}, 1"), places, slot)
        return []

    def add_up(slot: str, before: str) -> list[str]:
        after = page.put(f"add i32 {before}, {load(page, places, slot)}")
        store(page, before, places, slot)
        store(page, after, ends, slot)
        return [after]

    def move(connection: str) -> list[str]:
        slot = load(page, target, connection)
        place = load(page, places, slot)
        store(page, page.put(f"add i32 {place}, 1"), places, slot)
        store(page, load(page, source, connection), sorted_source, place)
        store(page, load(page, weight, connection), sorted_weight, place)  # as bits
        return []

    def empty(place: str) -> list[str]:
        store(page, "0", sorted_source, place)
        store(page, "0", sorted_weight, place)
        return []

    repeat(page, "0", str(nodes), [], clear)
    repeat(page, "0", count, [], tally)
    repeat(page, "0", str(nodes), [("i32", "0")], add_up)
    repeat(page, "0", count, [], move)
    repeat(page, count, str(connections), [], empty)
