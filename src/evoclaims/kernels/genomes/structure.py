"""Parts of structural mutation as kernels: loops over the connections that a genome has.

Most genomes are passed over: of those a kernel writes numbers, but no arrays. What an array holds there, or behind
what is written of it, is left to chance, and replaced by whoever calls the kernel. On a GPU a thread has a genome, and
the 32 threads that write together write to 32 places far apart: clearing arrays would take most of their time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Final

import jax
import jax.numpy as jnp
from jaxtyping import Array

from evoclaims.kernels.call.grouped import GroupKernel
from evoclaims.kernels.emit.control import load, repeat, store, walk, when
from evoclaims.kernels.emit.group_kernel import Rows
from evoclaims.kernels.emit.llvm_ir import Instructions

Function = Callable[..., Sequence[Array]]
PASSED_OVER: Final = -1
"""The number of connections of a genome to which a mutation does not happen."""
NAME: Final = "The breeding of genomes"


ONE: Final = jax.ShapeDtypeStruct((), jnp.int32)
"""The shape of a whole number."""


def _whole_numbers(size: int) -> jax.ShapeDtypeStruct:
    return jax.ShapeDtypeStruct((size,), jnp.int32)


def ordering_kernel(nodes: int, connections: int, function: Function) -> GroupKernel:
    """Return the kernel that makes room for a link between two slots in the topological order.

    Its arguments are the connections' sources and targets, their number or `PASSED_OVER`, and the source and the target
    of the link; its results are 1 if the link would close a cycle, else 0, the new place of each slot from the target
    to the source, and the slot that each of these places has its node from. `function` is the same in jax.
    """
    write = partial(_write_ordering, nodes, connections)
    slots, places = _whole_numbers(nodes), _whole_numbers(connections)
    return GroupKernel(NAME, function, (places, places, ONE, ONE, ONE), (), (ONE, slots, slots), write)


def removal_kernel(nodes: int, connections: int, visible: int, function: Function) -> GroupKernel:
    """Return the kernel that removes a hidden node's connections; hidden are the nodes of keys from `visible` on.

    Its arguments are the nodes' keys, the connections' sources, targets and weights, their number or `PASSED_OVER`, and
    how many hidden nodes are before the one to remove. Its results are that node's slot, or -1, the number of
    connections that are left, and these in the first places, in their order. `function` is the same in jax.
    """
    write = partial(_write_removal, nodes, visible)
    slots, places = _whole_numbers(nodes), _whole_numbers(connections)
    genes = places, places, jax.ShapeDtypeStruct((connections,), jnp.float32)
    return GroupKernel(NAME, function, (slots, *genes, ONE, ONE), (), (ONE, ONE, *genes), write)


def _write_ordering(
    nodes: int, connections: int, rows: Rows, groups: Sequence[str], given: Sequence[str], results: Sequence[str]
) -> None:
    """Write a search along the slots from target to source (Pearce and Kelly 2006, §3), which are in topological order.

    Connections to a slot are linked, from a head on.
    """
    page, (source, target, *numbers), (cycle, place, origin) = rows.page, groups, results
    heads, reached, following = (page.allocate("i32", size, 64) for size in (nodes, nodes, connections))
    count, last, first = (load(page, number) for number in numbers)
    happens = page.put(f"icmp sge i32 {count}, 0")
    after_last = page.put(f"select i1 {happens}, i32 {page.put(f'add i32 {last}, 1')}, i32 0")
    anything = page.put(f"icmp slt i32 {first}, {after_last}")
    linked = page.put(f"select i1 {anything}, i32 {count}, i32 0")

    def clear(slot: str) -> list[str]:
        store(page, "-1", heads, slot)
        return []

    def link(connection: str) -> list[str]:
        begins, ends = load(page, source, connection), load(page, target, connection)
        inside = page.put(
            f"and i1 {page.put(f'icmp sge i32 {begins}, {first}')}, {page.put(f'icmp sle i32 {ends}, {last}')}"
        )

        def add() -> str:
            store(page, load(page, heads, ends), following, connection)
            store(page, connection, heads, ends)
            return "true"

        when(page, inside, "i1", add, "false")
        return []

    def visit(slot: str, ahead: str) -> list[str]:
        def comes_from_reached(connection: str) -> str:
            return _is(page, load(page, reached, load(page, source, connection)), "ne", "0")

        def ends(connection: str) -> str:
            return when(page, _is(page, connection, "sge", "0"), "i1", lambda: comes_from_reached(connection), "true")

        found = walk(page, load(page, heads, slot), ends, lambda connection: load(page, following, connection))
        is_reached = page.put(f"or i1 {_is(page, found, 'sge', '0')}, {_is(page, slot, 'eq', first)}")
        store(page, page.put(f"zext i1 {is_reached} to i32"), reached, slot)
        return [page.put(f"add i32 {ahead}, {page.put(f'select i1 {is_reached}, i32 0, i32 1')}")]

    def move(slot: str, front: str, back: str) -> list[str]:
        to_back = load(page, reached, slot)
        moved = page.put(f"select i1 {_is(page, to_back, 'ne', '0')}, i32 {back}, i32 {front}")
        store(page, moved, place, slot)
        store(page, slot, origin, moved)
        to_front = page.put(f"sub i32 1, {to_back}")
        return [page.put(f"add i32 {front}, {to_front}"), page.put(f"add i32 {back}, {to_back}")]

    repeat(page, first, after_last, [], clear)
    repeat(page, "0", linked, [], link)
    (ahead,) = repeat(page, first, after_last, [("i32", "0")], visit)
    back = page.put(f"add i32 {first}, {ahead}")
    repeat(page, first, after_last, [("i32", first), ("i32", back)], move)
    store(page, when(page, anything, "i32", lambda: load(page, reached, last), "0"), cycle, "0")


def _write_removal(
    nodes: int, visible: int, rows: Rows, groups: Sequence[str], given: Sequence[str], results: Sequence[str]
) -> None:
    """Write a search for the node, and a loop over the connections; what is not kept is overwritten by the next."""
    page, (keys, *genes, number, which), (slot_at, left_at, *moved) = rows.page, groups, results
    count, chosen = load(page, number), load(page, which)
    happens = _is(page, count, "sge", "0")

    def look(slot: str, hidden: str, found: str) -> list[str]:
        is_hidden = _is(page, load(page, keys, slot), "sge", str(visible))
        is_it = page.put(f"and i1 {is_hidden}, {_is(page, hidden, 'eq', chosen)}")
        more = page.put(f"add i32 {hidden}, {page.put(f'zext i1 {is_hidden} to i32')}")
        return [more, page.put(f"select i1 {is_it}, i32 {slot}, i32 {found}")]

    size = page.put(f"select i1 {happens}, i32 {nodes}, i32 0")
    _, slot = repeat(page, "0", size, [("i32", "0"), ("i32", "-1")], look)

    def move(place: str, front: str) -> list[str]:
        *ends, weight = (load(page, gene, place) for gene in genes)
        for end, result in zip(ends, moved[:2], strict=True):
            behind = page.put(f"zext i1 {_is(page, end, 'sgt', slot)} to i32")
            store(page, page.put(f"sub i32 {end}, {behind}"), result, front)
        store(page, weight, moved[-1], front)
        kept = page.put(f"and i1 {_is(page, ends[0], 'ne', slot)}, {_is(page, ends[1], 'ne', slot)}")
        return [page.put(f"add i32 {front}, {page.put(f'zext i1 {kept} to i32')}")]

    there = page.put(f"select i1 {_is(page, slot, 'sge', '0')}, i32 {count}, i32 0")
    (left,) = repeat(page, "0", there, [("i32", "0")], move)
    store(page, slot, slot_at, "0")
    store(page, left, left_at, "0")


def _is(page: Instructions, number: str, relation: str, other: str) -> str:
    return page.put(f"icmp {relation} i32 {number}, {other}")
