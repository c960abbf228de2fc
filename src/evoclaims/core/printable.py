"""Text that no terminal obeys: what files, users and other machines say is shown, and never acted upon."""

from __future__ import annotations


def printable(text: object) -> str:
    """Return `text` with control characters and stray surrogates escaped: safe to print to any terminal."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in str(text))
