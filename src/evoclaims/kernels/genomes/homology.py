"""The search for homologous genes as a kernel: one genome's genes in hash tables, looked up for many others.

A call goes through all genomes that are compared with the same one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from evoclaims.kernels.emit.control import at, fill, load, repeat, store, walk, when
from evoclaims.kernels.emit.group_kernel import Rows
from evoclaims.kernels.emit.llvm_ir import Instructions

NAN: Final = str(0x7FC00000)
"""The bits of a float32."""
SPREAD: Final = -1640531527
"""2³² divided by the golden ratio: its multiples by consecutive keys lie far apart (Knuth 1998, §6.4)."""


class _Table:
    """Where each number of a list is: those of one hash are linked, from a head on."""

    def __init__(self, page: Instructions, numbers: str, capacity: int) -> None:
        """Start empty; `numbers` is the list's address."""
        bits = max(capacity - 1, 1).bit_length()
        self.page, self.numbers, self.shift, self.heads_count = page, numbers, 32 - bits, 1 << bits
        self.heads, self.following = (page.allocate("i32", count, 64) for count in (self.heads_count, capacity))

    def clear(self) -> None:
        """Forget all."""
        fill(self.page, self.heads, -1, self.heads_count)

    def add(self, place: str) -> None:
        """Add the number at a place of the list."""
        head = self._head(load(self.page, self.numbers, place))
        store(self.page, load(self.page, head), self.following, place)
        store(self.page, place, head, "0")

    def find(self, number: str) -> str:
        """Return the place of a number, or -1."""
        page = self.page

        def ends(place: str) -> str:
            def is_it() -> str:
                return page.put(f"icmp eq i32 {load(page, self.numbers, place)}, {number}")

            return when(page, is_place(page, place), "i1", is_it, "true")

        return walk(page, load(page, self._head(number)), ends, lambda place: load(page, self.following, place))

    def _head(self, number: str) -> str:
        """Return the address of the first place of a number's hash."""
        mixed = self.page.put(f"mul i32 {number}, {SPREAD}")
        return at(self.page, self.heads, self.page.put(f"lshr i32 {mixed}, {self.shift}"))


def write_search(
    capacity: tuple[int, int], rows: Rows, other: Sequence[str], genomes: Sequence[str], results: Sequence[str]
) -> None:
    """Write the search for genomes' genes in another.

    Args:
        capacity: nodes and connections.
        rows: of genomes.
        other: addresses of the leaves of the other genome.
        genomes: of the first genome's keys, sources, targets and counts.
        results: of the first genome's: the other's slot of each node or -1, its bias, response and activation or 0;
            the other's weight of each connection or NaN.
    """
    page, (nodes, connections) = rows.page, capacity
    keys, *attributes, sources, targets, weights, node_count, connection_count = other
    links = page.allocate("i32", connections, 64)
    by_key, by_link = _Table(page, keys, nodes), _Table(page, links, connections)

    def link(source: str, target: str) -> str:
        """Return a number that says which slots a connection joins."""
        return page.put(f"add i32 {page.put(f'mul i32 {target}, {nodes}')}, {source}")

    def add_node(slot: str) -> list[str]:
        by_key.add(slot)
        return []

    def add_connection(place: str) -> list[str]:
        store(page, link(load(page, sources, place), load(page, targets, place)), links, place)
        by_link.add(place)
        return []

    def search(row: str) -> list[str]:
        sizes = (nodes, connections, connections, 1, 1), (nodes, nodes, nodes, nodes, connections)
        (own_keys, own_sources, own_targets, *counts), (slots, *found, found_weights) = (
            [at(page, array, page.put(f"mul i32 {row}, {size}")) for array, size in zip(arrays, of, strict=True)]
            for arrays, of in zip((genomes, results), sizes, strict=True)
        )
        own_nodes, own_connections = (load(page, count) for count in counts)

        def find_node(slot: str) -> list[str]:
            place = by_key.find(load(page, own_keys, slot))
            store(page, place, slots, slot)
            some = page.call("llvm.smax.i32", "i32", [("i32", place), ("i32", "0")])
            for array, result in zip(attributes, found, strict=True):
                store(page, load(page, array, some), result, slot)
            return []

        def no_node(slot: str) -> list[str]:
            store(page, "-1", slots, slot)
            for result in found:
                store(page, "0", result, slot)
            return []

        def find_connection(place: str) -> list[str]:
            source, target = (load(page, slots, load(page, ends, place)) for ends in (own_sources, own_targets))
            nodes_there = is_place(page, page.put(f"or i32 {source}, {target}"))
            at_other = when(page, nodes_there, "i32", lambda: by_link.find(link(source, target)), "-1")
            there = is_place(page, at_other)
            store(page, when(page, there, "i32", lambda: load(page, weights, at_other), NAN), found_weights, place)
            return []

        def no_connection(place: str) -> list[str]:
            store(page, NAN, found_weights, place)
            return []

        repeat(page, "0", own_nodes, [], find_node)
        repeat(page, own_nodes, str(nodes), [], no_node)
        repeat(page, "0", own_connections, [], find_connection)
        repeat(page, own_connections, str(connections), [], no_connection)
        return []

    by_key.clear()
    by_link.clear()
    repeat(page, "0", load(page, node_count), [], add_node)
    repeat(page, "0", load(page, connection_count), [], add_connection)
    repeat(page, "0", rows.count, [], search)


def write_look_up(
    step: int, none: int, rows: Rows, other: Sequence[str], wanted: Sequence[str], results: Sequence[str]
) -> None:
    """Write the search for numbers in a list, compared `step` at a time; what equals `none` is not searched for.

    Args:
        step: a divisor of the list's length.
        none: a number that is not searched for.
        rows: numbers to search for.
        other: addresses of the list, of a weight for each of its numbers, and of how many of them count.
        wanted: of the first number to search for.
        results: of its weight, or NaN.
    """
    page, (links, weights, count_at) = rows.page, other
    count = load(page, count_at)

    def search(row: str) -> list[str]:
        link = load(page, wanted[0], row)
        is_searched = page.put(f"icmp ne i32 {link}, {none}")
        place = find(page, links, link, page.put(f"select i1 {is_searched}, i32 {count}, i32 0"), step)
        store(page, when(page, is_place(page, place), "i32", lambda: load(page, weights, place), NAN), results[0], row)
        return []

    repeat(page, "0", rows.count, [], search)


def find(page: Instructions, numbers: str, number: str, end: str, step: int) -> str:
    """Write a search among the first numbers of a list; return the place, or -1.

    Args:
        page: where to.
        numbers: address of the list.
        number: is searched for.
        end: how many numbers of the list count; those behind, up to a multiple of `step`, must be others.
        step: numbers that are compared at a time.
    """

    def here(place: str) -> list[str]:
        """Return which of the next numbers it is."""
        places = [place, *(page.put(f"add i32 {place}, {more}") for more in range(1, step))]
        return [page.put(f"icmp eq i32 {each}, {number}") for each in [load(page, numbers, at) for at in places]]

    def any_here(place: str) -> str:
        found, *others = here(place)
        for each in others:
            found = page.put(f"or i1 {found}, {each}")
        return found

    def ends(place: str) -> str:
        inside = page.put(f"icmp slt i32 {place}, {end}")
        return when(page, inside, "i1", lambda: any_here(place), "true")

    def exact(place: str) -> str:
        found = place
        for more, is_it in list(enumerate(here(place)))[1:]:
            later = page.put(f"add i32 {place}, {more}")
            found = page.put(f"select i1 {is_it}, i32 {later}, i32 {found}")
        return found

    place = walk(page, "0", ends, lambda place: page.put(f"add i32 {place}, {step}"))
    return when(page, page.put(f"icmp slt i32 {place}, {end}"), "i32", lambda: exact(place), "-1")


def is_place(page: Instructions, number: str) -> str:
    """Return whether a number is a place, not -1."""
    return page.put(f"icmp sge i32 {number}, 0")
