"""The exception for functions that cannot be compiled to one kernel."""

from __future__ import annotations


class Unsupported(Exception):  # noqa: N818  (not an error: the function runs without a kernel)
    """A function uses something that kernels do not support; the message says what."""
