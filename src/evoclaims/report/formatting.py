"""Numbers, texts and Markdown as readers see them."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable
from html import escape
from itertools import chain, count
from typing import Final

from evoclaims.core.printable import printable

_PLACE: Final = re.compile(r"§\s*(\d+(?:\.\d+)*)")


def clean(text: object) -> str:
    """Return a text on one line, without control characters or characters that no file can hold."""
    return printable(" ".join(str(text).split()))


def number(value: float | None) -> str:
    """Return a number with four significant digits; a dash for None."""
    if value is None:
        return "–"
    if math.isnan(value):
        return "NaN"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    return f"{value + 0.0:.4g}".replace("-", "−")


def p_value(value: float | None) -> str:
    """Return a p value with two significant digits; a dash for None."""
    return "–" if value is None else f"{value:.2g}"


def large(value: float) -> str:
    """Return a number of steps, such as "150 M"."""
    for size, unit in ((1e9, " G"), (1e6, " M"), (1e3, " k")):
        if abs(value) >= size:
            return f"{value / size:.3g}{unit}"
    return f"{value:.3g}"


def places(where: str) -> tuple[str, ...]:
    """Return the sections that a place in the paper names, such as ("§5.1",); without any, its own words."""
    found = tuple(dict.fromkeys(f"§{digits}" for digits in _PLACE.findall(where)))
    return found or (clean(where) or "elsewhere",)


def place_key(place: str) -> tuple[bool, list[int], str]:
    """Return a sort key for places in the paper: numbered sections first, §5.2 before §5.10."""
    return place[:1] != "§", [int(digits) for digits in re.findall(r"\d+", place)], place


def plural(count: int, word: str, several: str = "") -> str:
    """Return "1 trial", "2 trials"; the plural is `several` where that is not the word with an s."""
    return f"{count} {word if count == 1 else several or f'{word}s'}"


def listed(values: Iterable[object], most: int = 12) -> str:
    """Return values joined by commas; the number of the rest where there are many."""
    texts = [clean(value) for value in values]
    rest = len(texts) - most
    return ", ".join(texts[:most]) + (f" and {rest} more" if rest > 0 else "")


def counted(values: Iterable[str]) -> str:
    """Return how often each value occurs, the commonest first, such as "5 × cpu, 2 × gpu"."""
    return listed(f"{count} × {value}" for value, count in Counter(values).most_common())


class Anchors:
    """Names of places in a page: readable, safe in a URL, and each used once."""

    def __init__(self) -> None:
        """Start without any."""
        self._given: set[str] = set()

    def new(self, *parts: str) -> str:
        """Return a name such as "G1-n_parity-full"."""
        slugs = [re.sub(r"[^A-Za-z0-9_.-]+", "-", part).strip("-.") for part in parts]
        name = "-".join(slug for slug in slugs if slug) or "claim"
        again = (f"{name}-{index}" for index in count(2))
        new = next(one for one in chain([name], again) if one not in self._given)
        self._given.add(new)
        return new


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
