"""File names for texts of any kind: readable, short enough, and different for different texts."""

from __future__ import annotations

import hashlib
import re
from typing import Final

LONGEST: Final = 120
"""Most characters of a name; a file system takes 255 bytes, of which endings and temporary names need some."""

_HASH_DIGITS: Final = 16
_WORD: Final = r"[A-Za-z0-9_][A-Za-z0-9_.]*"
_PLAIN: Final = re.compile(rf"{_WORD}(-[A-Za-z0-9_.-]+)?")


def file_name(first: str, second: str = "") -> str:
    """Return a name, without an ending, for a text, or for two: "G1-n_parity" for "G1" and "n_parity".

    Where such a name would not tell them apart from others (it leaves characters out, is cut short, or has a dash
    before the one in the middle), a hash of both stands at its end, behind a "~", which no other name contains.
    """
    joined = f"{first}-{second}" if second else first
    if "-" not in first and len(joined) <= LONGEST and _PLAIN.fullmatch(joined):
        return joined
    slug = re.sub(r"[^A-Za-z0-9_.-]+", "-", joined).strip("-.") or "_"
    # The length of the first text says where it ends, so that no two pairs are hashed from one text.
    whole = f"{len(first)}:{first}{second}".encode("utf-8", errors="surrogatepass")
    mark = f"~{hashlib.sha256(whole).hexdigest()[:_HASH_DIGITS]}"
    return f"{slug[: LONGEST - len(mark)]}{mark}"
