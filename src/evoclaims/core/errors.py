"""Errors meant for people: each carries one sentence that says what was wrong and what to do."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from evoclaims.core.printable import shown


class UserError(Exception):
    """An error that a user can cause and correct; shown as its message, without a traceback, and safe to print."""

    def __init__(self, message: object) -> None:
        """Keep a sentence, whatever the names in it hold."""
        super().__init__(shown(message))


class UnknownNameError(UserError):
    """A name that nothing is known under; the message lists the known names."""

    def __init__(self, kind: str, name: object, known: Iterable[str]) -> None:
        """Build the sentence for `kind` (such as "method"), the wrong `name` and the `known` ones."""
        names = sorted(known)
        near = difflib.get_close_matches(str(name), names, n=1)
        guess = f" Did you mean {near[0]!r}?" if near else ""
        super().__init__(f"There is no {kind} named {name!r}.{guess} Known: {', '.join(names)}.")
