"""A genome's connections, sorted by the node that they lead to, as a kernel: a counting sort."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
from jaxtyping import Array

from evoclaims.kernels.call.grouped import GroupKernel
from evoclaims.kernels.emit.control import repeat
from evoclaims.kernels.emit.group_kernel import Rows
from evoclaims.kernels.emit.words import load, store


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
