"""What cannot be a kernel."""

from __future__ import annotations


class Unsupported(Exception):  # noqa: N818  (nothing has gone wrong: the function runs as any other)
    """The function has something that has no scalar expression here; says what."""
