"""Parts of structural mutation as kernels: loops over the connections that a genome has."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import jax
import jax.numpy as jnp
from jaxtyping import Array

from evoclaims.kernels.control import repeat, walk, when
from evoclaims.kernels.group_kernel import Rows
from evoclaims.kernels.grouped import GroupKernel
from evoclaims.kernels.words import fill, load, store

Function = Callable[..., Sequence[Array]]


def descendants_kernel(nodes: int, connections: int, function: Function) -> GroupKernel:
    """Return the kernel that marks which slots one leads to, itself included, by 1.

    Its arguments are the connections' sources and targets, their number, and the slot; `function` is the same in jax.
    """
    places, one, slots = (jax.ShapeDtypeStruct(shape, jnp.int32) for shape in ((connections,), (), (nodes,)))
    write = partial(_write_descendants, nodes, connections)
    return GroupKernel("The breeding of genomes", function, (places, places, one, one), (), (slots,), write)


def packing_kernel(connections: int, function: Function) -> GroupKernel:
    """Return the kernel that moves the kept connections to the front, in their order, and 0 behind them.

    Its arguments are the connections' sources, targets and weights, 1 for those that are kept, 0 for the others, and
    how many of all these count; `function` is the same in jax.
    """
    places, numbers = (jax.ShapeDtypeStruct((connections,), dtype) for dtype in (jnp.int32, jnp.float32))
    one = jax.ShapeDtypeStruct((), jnp.int32)
    genes = places, places, numbers
    write = partial(_write_packed, connections)
    return GroupKernel("The breeding of genomes", function, (*genes, places, one), (), genes, write)


def _write_descendants(
    nodes: int, connections: int, rows: Rows, groups: Sequence[str], given: Sequence[str], results: Sequence[str]
) -> None:
    """Write a search along the slots, which are in topological order; connections to a slot are linked, from a head."""
    page, (source, target, *numbers), (reached,) = rows.page, groups, results
    heads, following = page.allocate("i32", nodes, 64), page.allocate("i32", connections, 64)
    count, start = (load(page, number) for number in numbers)

    def link(connection: str) -> list[str]:
        slot = load(page, target, connection)
        store(page, load(page, heads, slot), following, connection)
        store(page, connection, heads, slot)
        return []

    def visit(slot: str) -> list[str]:
        def ends(connection: str) -> str:
            there = page.put(f"icmp sge i32 {connection}, 0")
            return when(page, there, "i1", lambda: comes_from_reached(connection), "true")

        def comes_from_reached(connection: str) -> str:
            return page.put(f"icmp ne i32 {load(page, reached, load(page, source, connection))}, 0")

        found = walk(page, load(page, heads, slot), ends, lambda connection: load(page, following, connection))
        is_reached = page.put(f"icmp sge i32 {found}, 0")
        store(page, page.put(f"zext i1 {is_reached} to i32"), reached, slot)
        return []

    fill(page, heads, -1, nodes)
    fill(page, reached, 0, nodes)
    repeat(page, "0", count, [], link)
    store(page, "1", reached, start)
    repeat(page, page.put(f"add i32 {start}, 1"), str(nodes), [], visit)


def _write_packed(
    connections: int, rows: Rows, groups: Sequence[str], given: Sequence[str], results: Sequence[str]
) -> None:
    """Write a loop over the places that count; what is not kept is overwritten by the next."""
    page, (*genes, kept, number) = rows.page, groups

    def move(place: str, front: str) -> list[str]:
        for gene, result in zip(genes, results, strict=True):
            store(page, load(page, gene, place), result, front)
        return [page.put(f"add i32 {front}, {load(page, kept, place)}")]

    def clear(place: str) -> list[str]:
        for result in results:
            store(page, "0", result, place)
        return []

    (front,) = repeat(page, "0", load(page, number), [("i32", "0")], move)
    repeat(page, front, str(connections), [], clear)
