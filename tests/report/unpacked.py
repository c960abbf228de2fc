"""The page with its packed pieces unpacked, as its script does it."""

from __future__ import annotations

import base64
import gzip
import json
import re

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
    text = html(page)
    return _PACKED.sub("", text) + "".join(pieces(text).values())
