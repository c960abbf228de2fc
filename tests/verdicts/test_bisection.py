"""The search for a change: it is found wherever it is, by few questions, and round what cannot be said."""

from __future__ import annotations

from math import ceil, log2

from hypothesis import given
from hypothesis import strategies as st

from evoclaims.cli.bisect import bisect


@st.composite
def rows(draw: st.DrawFn) -> tuple[int, int, frozenset[int]]:
    """Return a length, the index of the change, and members strictly inside that nothing can be said about."""
    length = draw(st.integers(2, 60))
    change = draw(st.integers(1, length - 1))
    return length, change, draw(st.frozensets(st.integers(1, max(length - 2, 1)), max_size=length // 2)) - {length - 1}


@given(rows())
def test_the_change_lies_between_the_two_that_are_told_with_only_unknown_members_between_them(
    row: tuple[int, int, frozenset[int]],
) -> None:
    length, change, unknown = row
    asked: list[int] = []

    def has_changed(index: int) -> bool | None:
        asked.append(index)
        return None if index in unknown else index >= change

    found = bisect(length, has_changed)
    assert found.before < change <= found.after
    assert found.unknown == tuple(range(found.before + 1, found.after))
    assert unknown.issuperset(found.unknown)
    assert len(asked) == len(set(asked))
    assert {0, length - 1}.isdisjoint(asked)
    assert len(asked) - len(unknown.intersection(asked)) <= (ceil(log2(length - 1)) if not unknown else length - 2)
