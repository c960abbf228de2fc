"""Texts and tables in Markdown that shows them as they are."""

from __future__ import annotations

import re
from collections.abc import Iterable
from html import escape
from typing import Final

from evoclaims.report.formatting import clean

_MARKS: Final = re.compile(r"([\\`*_\[\]#|~$@]|^[-+=]|:(?=[/\w]))")
"""What means something to Markdown, or to a forge that links names and addresses."""

_ITEM: Final = re.compile(r"^(\d+)([.)])(?=\s|$)")


def literal(text: str) -> str:
    """Return a text that Markdown, and HTML within it, shows as it is, on one line."""
    marked = escape(_MARKS.sub(r"\\\1", clean(text)), quote=False)
    return _ITEM.sub(r"\1\\\2", marked).replace("www.", "www\\.")


def table(header: Iterable[str], rows: Iterable[Iterable[str]], numbers: Iterable[str] = ()) -> str:
    """Return a table of cells that are Markdown already.

    Args:
        header: one heading a column.
        rows: one cell a column.
        numbers: headings of columns that are set to the right.
    """
    head, right = list(header), set(numbers)
    lines = [head, ["---:" if name in right else "---" for name in head], *map(list, rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
