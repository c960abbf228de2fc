"""Texts and tables in Markdown, shown as they are."""

from __future__ import annotations

import re
from collections.abc import Iterable
from html import escape
from typing import Final

from evoclaims.report.formatting import clean

_MARKS: Final = re.compile(r"([\\`*_\[\]#|~$@]|^[-+=]|:(?=[/\w]))")
"""Characters with a meaning in Markdown, or on a forge that links names and addresses."""

_ITEM: Final = re.compile(r"^(\d+)([.)])(?=\s|$)")


def literal(text: str) -> str:
    """Escape a text so that Markdown, and HTML in it, shows it unchanged, on one line."""
    marked = escape(_MARKS.sub(r"\\\1", clean(text)), quote=False)
    return _ITEM.sub(r"\1\\\2", marked).replace("www.", "www\\.")


def table(header: Iterable[str], rows: Iterable[Iterable[str]], numbers: Iterable[str] = ()) -> str:
    """Return a table of cells that are Markdown already.

    Args:
        header: one heading per column.
        rows: one cell per column.
        numbers: headings of columns that are aligned right.
    """
    head, right = list(header), set(numbers)
    lines = [head, ["---:" if name in right else "---" for name in head], *map(list, rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
