"""What a page's Content-Security-Policy allows."""

from __future__ import annotations

import base64
import hashlib


def exactly(text: str) -> str:
    """Return the source expression that allows exactly this script or style."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
