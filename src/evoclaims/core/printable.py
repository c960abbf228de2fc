"""Text that is safe to print: control characters from files, users and other machines never reach a terminal.

Text is made printable where it leaves the program: in the message of every `UserError`, in what commands print
(`cli.terminal`), in rich tables (`report.console`), and in the pytest plugin's output (`plugin.summary`). Text for
other files, such as Markdown, is escaped where they are written.
"""

from __future__ import annotations

from typing import Final

_KEPT: Final = frozenset("\n\t")

_PLAIN: Final = str.maketrans(
    {"✓": "+", "✗": "x", "×": "x", "–": "-", "…": "...", "·": "/", "≤": "<=", "≥": ">=", "α": "alpha", "§": "sec. "}
)
"""Replacements for table symbols that a terminal lacks; any other character is written as its code number."""


def printable(text: object) -> str:
    """Return `text` with control characters and lone surrogates escaped: one line, safe to print to any terminal."""
    plain = str(text)
    return plain if plain.isprintable() else "".join(map(_shown, plain))


def shown(text: object) -> str:
    """Return `text` as `printable` does, but keep newlines and tabs."""
    return "".join(c if c in _KEPT else _shown(c) for c in str(text))


def spelled(text: str, encoding: str | None) -> str:
    """Return `text` in characters that this encoding supports."""
    try:
        text.encode(encoding or "utf-8")
    except (UnicodeEncodeError, LookupError):
        return text.translate(_PLAIN).encode("ascii", errors="backslashreplace").decode("ascii")
    return text


def _shown(character: str) -> str:
    """Return a character, escaped if it would control a terminal or cannot be written."""
    return character if character.isprintable() else character.encode("unicode_escape").decode("ascii")
