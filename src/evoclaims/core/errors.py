"""Errors meant for users: each has one sentence that says what was wrong and what to do."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterable

from evoclaims.core.printable import shown


class UserError(Exception):
    """An error that a user can cause and fix; shown as its message, without a traceback, and safe to print."""

    def __init__(self, message: object) -> None:
        """Store the message, made safe to print."""
        super().__init__(shown(message))


class StorageError(UserError):
    """A file that cannot be written, or a stored one that cannot be used: what ran is not to blame."""


class UnknownNameError(UserError):
    """An unknown name; the message lists the known names."""

    def __init__(self, kind: str, name: object, known: Iterable[str]) -> None:
        """Build the message from `kind` (such as "method"), the wrong `name` and the `known` ones."""
        super().__init__(f"There is no {kind} named {name!r}.{guess(name, known)}")


def require_known(kind: str, name: object, known: Collection[object]) -> None:
    """Raise an `UnknownNameError`, for a `kind` such as "method", unless the name is known."""
    if name not in known:
        raise UnknownNameError(kind, name, map(str, known))


def require_at_least(least: float, whose: str, **values: float) -> None:
    """Raise a `UserError`, such as "PPO's minibatches must be at least 1, not 0.", for a value below `least`."""
    for name, value in values.items():
        if value < least:
            raise UserError(f"{whose} {name} must be at least {least}, not {value}.")


def guess(name: object, known: Iterable[str]) -> str:
    """Return what follows on an unknown name: the known one that it resembles, if any, and all known ones."""
    names = sorted(known)
    near = difflib.get_close_matches(str(name), names, n=1)
    meant = f" Did you mean {near[0]!r}?" if near else ""
    return f"{meant} Known: {', '.join(names) or 'none'}."
