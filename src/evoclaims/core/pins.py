"""Files of pins, as pip and pip-compile write them: a requirement may go on over several lines, and may have hashes."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Final

from packaging.utils import canonicalize_name

_NAME: Final = re.compile(r"\s*[\w.-]+")

_HASH: Final = re.compile(r"(?:\s|\\\n)+--hash(?:=|(?:\s|\\\n)+)\w+:[0-9a-fA-F]+")
"""A hash with what stands before it: "\\", the end of a line, and blanks."""


def without(pins: str, package: str) -> str:
    """Return a file of pins without those of a package; no other character changes."""
    own = canonicalize_name(package)
    named = ((_NAME.match(entry), entry) for entry in _entries(pins))
    return "".join(entry for name, entry in named if not name or canonicalize_name(name[0].strip()) != own)


def without_hashes(pins: str) -> str:
    """Return a file of pins without hashes; no other character changes."""
    return "".join(_HASH.sub("", entry) for entry in _entries(pins))


def _entries(pins: str) -> Iterator[str]:
    """Yield each requirement, option, comment and empty line, with the lines over which it goes on.

    As pip reads them, a line that ends with a backslash goes on, unless it is a comment.
    """
    lines: list[str] = []
    for line in pins.splitlines(keepends=True):
        lines.append(line)
        if line.lstrip().startswith("#") or not line.rstrip("\n").endswith("\\"):
            yield "".join(lines)
            lines = []
    yield "".join(lines)
