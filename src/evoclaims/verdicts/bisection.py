"""The place in a row where something changed, found by asking about as few members as possible."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Change:
    """Where it changed.

    Attributes:
        before: index of the last member that is still as the first.
        after: index of the first member that is as the last.
        unknown: the members between these, about which nothing is known.
    """

    before: int
    after: int
    unknown: tuple[int, ...] = ()


def bisect(length: int, has_changed: Callable[[int], bool | None]) -> Change:
    """Return where a row of members changes, if it changes once.

    Args:
        length: of the row, at least two; the first member has not changed, and the last one has.
        has_changed: whether the member at an index has; None if that is unknown, so that another one near it is
            asked about. It is called at most once for each.
    """
    before, after = 0, length - 1
    unknown: set[int] = set()
    while left := [index for index in range(before + 1, after) if index not in unknown]:
        asked = min(left, key=lambda index: abs(2 * index - before - after))
        answer = has_changed(asked)
        if answer is None:
            unknown.add(asked)
        elif answer:
            after = asked
        else:
            before = asked
    return Change(before, after, tuple(sorted(index for index in unknown if before < index < after)))
