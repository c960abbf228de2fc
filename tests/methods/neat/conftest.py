"""One long evolution, run once for all the tests that look at it."""

from __future__ import annotations

import jax
import pytest
from history import History, evolved


@pytest.fixture(scope="session")
def history() -> History:
    """Two hundred generations, on the host."""
    with jax.numpy_dtype_promotion("strict"), jax.numpy_rank_promotion("raise"), jax.debug_key_reuse(True):
        return evolved()
