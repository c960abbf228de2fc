"""The page with its packed pieces unpacked, as its script does it."""

from __future__ import annotations

import base64
import gzip
import json
import re
from pathlib import Path

from evoclaims.report.html import html
from evoclaims.report.model import Page

_PACKED = re.compile(r'<template id="pieces">([A-Za-z0-9+/=]*)</template>')


def pieces(text: str) -> dict[str, str]:
    """Return what is packed in a page, HTML by name."""
    (packed,) = _PACKED.findall(text)
    found: dict[str, str] = json.loads(gzip.decompress(base64.b64decode(packed)))
    return found


def whole(page: Page) -> str:
    """Return the page with all its pieces at the end, each once."""
    return _unpacked(html(page))


def read(path: Path) -> str:
    """Return a written page in the same way; a Markdown file as it is."""
    text = path.read_text()
    return _unpacked(text) if path.suffix == ".html" else text


def _unpacked(text: str) -> str:
    """Put what is packed at the end."""
    return _PACKED.sub("", text) + "".join(pieces(text).values())
