"""Calling libraries that rely on jax's implicit promotions, which this project's own code does not use."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import jax


@contextlib.contextmanager
def implicit_promotions() -> Iterator[None]:
    """Allow implicit promotion of dtype and rank while another library's functions are called or traced."""
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        yield
