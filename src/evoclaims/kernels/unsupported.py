"""The exception for functions that cannot be compiled to one kernel."""

from __future__ import annotations


class Unsupported(Exception):  # noqa: N818  (nothing has gone wrong: the function runs as any other)
    """A function uses something that kernels do not support; the message says what."""
