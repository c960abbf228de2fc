"""Which settings differ between two trials' specifications: why their conditions are not the same."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from evoclaims.core.printable import printable

MOST: Final = 5
"""Most settings that a sentence lists."""


def changed_settings(old: Mapping[str, Any], new: Mapping[str, Any]) -> str:
    """Return the settings that differ, such as "method.settings.sigma 0.5 -> 0.3"; empty if none does.

    The seed is no setting; "none" stands for a setting that one side does not have. Of an edited robot only a
    hash of its model is known, so its file is named.
    """
    before, after = (dict(_leaves("", {**spec, "seed": None})) for spec in (old, new))
    names = sorted(name for name in before.keys() | after.keys() if before.get(name) != after.get(name))
    shown = []
    for name in names:
        file, both = f"{name.removesuffix('.body')}.xml", before.keys() & after.keys()
        if not name.endswith(".body") or not {name, file} <= both:
            shown.append(f"{name} {before.get(name, 'none')} -> {after.get(name, 'none')}")
        elif file not in names:  # otherwise another file has another model anyway
            shown.append(f"{file} {after[file]}: this file, or one that it includes, was edited")
    more = [f"and {len(shown) - MOST} more"] if len(shown) > MOST else []
    return printable(", ".join([*shown[:MOST], *more]))


def _leaves(name: str, value: Any) -> Iterator[tuple[str, str]]:
    """Yield what a nested table holds, as texts by dotted names; an empty table or list is a value."""
    parts = value.items() if isinstance(value, Mapping) else enumerate(value) if isinstance(value, list | tuple) else ()
    found = [leaf for key, part in parts for leaf in _leaves(f"{name}.{key}" if name else str(key), part)]
    yield from found or [(name, repr(value))]
