"""Why trials of a custom robot run again: its model was edited after they had run."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from typing import Any

from evoclaims.trials.spec import Condition
from evoclaims.trials.store import DamagedFileError, Store


def warn_of_edited_bodies(condition: Condition, store: Store) -> None:
    """Warn when the store has trials of the condition whose robot had the same file and another body."""
    now = dict(_bodies(condition.plain))
    if not now:
        return
    errors: list[DamagedFileError] = []
    here = _without_bodies(condition.plain)
    old = [
        result
        for result in store.results(errors)
        if result.condition != condition.id
        and _without_bodies({name: part for name, part in result.spec.items() if name != "seed"}) == here
    ]
    if old:
        names = sorted({name for result in old for name, body in _bodies(result.spec) if now.get(name) != body})
        warnings.warn(
            f"The model of the robot {', '.join(names)} was edited: {len(old)} stored trials of {condition.label} are "
            "of the old body and do not count, so they run again.",
            stacklevel=2,
        )


def _bodies(plain: Any) -> Iterator[tuple[str, str]]:
    """Yield names and body hashes of the custom robots in a condition's plain form."""
    if isinstance(plain, Mapping):
        if {"xml", "body", "name"} <= plain.keys():
            yield plain["name"], plain["body"]
        for part in plain.values():
            yield from _bodies(part)
    elif isinstance(plain, list | tuple):
        for part in plain:
            yield from _bodies(part)


def _without_bodies(plain: Any) -> Any:
    """Return a condition's plain form without its robots' body hashes."""
    if isinstance(plain, Mapping):
        return {name: _without_bodies(part) for name, part in plain.items() if not (name == "body" and "xml" in plain)}
    return [_without_bodies(part) for part in plain] if isinstance(plain, list | tuple) else plain
