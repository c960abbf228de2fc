"""File names for any text: readable, short enough, and different for different texts."""

from __future__ import annotations

import hashlib
import re
from typing import Final

LONGEST: Final = 120
"""Most characters in a name; file systems allow 255 bytes, and suffixes and temporary names need some."""

_HASH_DIGITS: Final = 16
_WORD: Final = r"[A-Za-z0-9_][A-Za-z0-9_.]*"
_PLAIN: Final = re.compile(rf"{_WORD}(-[A-Za-z0-9_.-]+)?")


def file_name(first: str, second: str = "") -> str:
    """Return a name, without a suffix, for one text or two: "G1-n_parity" for "G1" and "n_parity".

    A name that would be ambiguous (characters dropped, text cut short, or a dash in the first text) ends in "~" and
    a hash of both texts; no other name contains a "~".
    """
    joined = f"{first}-{second}" if second else first
    if "-" not in first and len(joined) <= LONGEST and _PLAIN.fullmatch(joined):
        return joined
    slug = re.sub(r"[^A-Za-z0-9_.-]+", "-", joined).strip("-.") or "_"
    # The length of the first text says where it ends, so two pairs never hash the same text.
    whole = f"{len(first)}:{first}{second}".encode("utf-8", errors="surrogatepass")
    mark = f"~{hashlib.sha256(whole).hexdigest()[:_HASH_DIGITS]}"
    return f"{slug[: LONGEST - len(mark)]}{mark}"
