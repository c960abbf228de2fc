"""Text that no terminal obeys: what files, users and other machines say is shown, and never acted upon.

Text is made printable where it leaves the program: in the message of every `UserError`, in what commands print
(`cli.terminal`), in rich tables (`report.console`), and in what the pytest plugin adds to a run (`plugin.summary`).
What is written into other files, such as Markdown, is made so for them where they are written.
"""

from __future__ import annotations

from typing import Final

_KEPT: Final = frozenset("\n\t")

_PLAIN: Final = str.maketrans(
    {"✓": "+", "✗": "x", "×": "x", "–": "-", "…": "...", "·": "/", "≤": "<=", "≥": ">=", "α": "alpha", "§": "sec. "}
)
"""What is written for the signs of a table where a terminal lacks them; of any other character, its number is."""


def printable(text: object) -> str:
    """Return `text` with control characters and stray surrogates escaped: one line, safe to print to any terminal."""
    plain = str(text)
    return plain if plain.isprintable() else "".join(map(_shown, plain))


def shown(text: object) -> str:
    """Return `text` as `printable` does, but with its lines and tabs: it may be a whole output."""
    return "".join(c if c in _KEPT else _shown(c) for c in str(text))


def spelled(text: str, encoding: str | None) -> str:
    """Return `text` in characters that a terminal of this encoding has."""
    try:
        text.encode(encoding or "utf-8")
    except (UnicodeEncodeError, LookupError):
        return text.translate(_PLAIN).encode("ascii", errors="backslashreplace").decode("ascii")
    return text


def _shown(character: str) -> str:
    """Return a character, or what stands for it where it would steer a terminal or cannot be written."""
    return character if character.isprintable() else character.encode("unicode_escape").decode("ascii")
