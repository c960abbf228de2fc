"""How xdist gives claims to its workers: one ahead of the one that runs, in the order of `claims.workload`."""

from __future__ import annotations

from typing import Any

import pytest
from xdist.scheduler import LoadScheduling

from evoclaims.claims.workload import Order, Workload

LOAD: pytest.StashKey[Workload] = pytest.StashKey()
"""Where xdist's controller keeps what its workers have to do."""


class ClaimScheduling(LoadScheduling):  # type: ignore[misc]  # xdist is not typed
    """xdist's own distribution (`--dist load`), but for claims, which change places among themselves.

    A worker needs to know its next test before it runs one, so that it has two claims at a time and no more.
    """

    _order: Order[Any] | None = None

    def schedule(self) -> None:
        """Give each worker its first tests."""
        load = self.config.stash.get(LOAD, None)
        if self._order is None and load is not None:
            self._order = Order(load, len(self.nodes))
        super().schedule()

    def mark_test_complete(self, node: Any, item_index: int, duration: float = 0) -> None:
        """Note that a test has ended, and give its worker more."""
        claim = self.collection[item_index] if self.collection else ""
        if self._order is not None and self._order.knows(claim):
            self._order.ended(claim)
        super().mark_test_complete(node, item_index, duration)

    def remove_node(self, node: Any) -> str | None:
        """Give the tests of a worker that has died, or ended, to others."""
        if self._order is not None:
            self._order.lost(node)
        crashed: str | None = super().remove_node(node)
        return crashed

    def _send_tests(self, node: Any, num: int) -> None:
        """Give a worker up to `num` tests: others as they come, and where a claim comes, the one that is due."""
        order, collection, chosen = self._order, self.collection or [], list[int]()
        while self.pending and len(chosen) < num:
            index = self.pending[0]
            if order is not None and order.knows(collection[index]):
                if len(self.node2pending[node]) + len(chosen) >= 2:
                    break
                waiting = {collection[one]: one for one in self.pending if order.knows(collection[one])}
                index = waiting[order.next(node, list(waiting))]
                # The claim that comes takes the place of the one that is due.
                self.pending[self.pending.index(index)] = self.pending[0]
            del self.pending[0]
            chosen.append(index)
        if chosen:
            self.node2pending[node].extend(chosen)
            node.send_runtest_some(chosen)
