"""A table of names: one line registers an algorithm, and nobody compares names with `if`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Generic, TypeVar

from evoclaims.core.errors import UnknownNameError

T = TypeVar("T")


class Registry(Mapping[str, T], Generic[T]):
    """A read-only mapping whose missing keys raise `UnknownNameError` with the known names."""

    def __init__(self, kind: str, entries: Mapping[str, T]) -> None:
        """Hold `entries`; `kind` ("method", "task") is the word used in error sentences."""
        self._kind = kind
        self._entries = dict(entries)

    def __getitem__(self, name: str) -> T:
        """Return the entry called `name`, or raise `UnknownNameError`."""
        if name not in self._entries:
            raise UnknownNameError(self._kind, name, self._entries)
        return self._entries[name]

    def __contains__(self, name: object) -> bool:
        """Whether `name` is registered."""
        return name in self._entries

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names in the order of registration."""
        return iter(self._entries)

    def __len__(self) -> int:
        """Number of entries."""
        return len(self._entries)
