"""Named streams of random keys: each use has a name, and a new name shifts no other stream."""

from __future__ import annotations

import hashlib
from typing import Final

import jax
import numpy as np

TRAINING: Final = "training"
EVALUATION: Final = "evaluation"


def _stable_int(name: str) -> int:
    """Hash `name` to 32 bits, the same on every machine and in every version of Python."""
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:4], "big")


def stream(key: jax.Array, name: str) -> jax.Array:
    """Derive one key (typed, shape []) per use, told apart by `name`."""
    return jax.random.fold_in(key, _stable_int(name))


def streams(key: jax.Array, *names: str) -> tuple[jax.Array, ...]:
    """Return one key per name.

    `mutate_key, eval_key = streams(key, "mutate", "eval")`
    """
    # The same keys as one after the other, but one call of the generator to compile instead of many.
    return tuple(
        jax.vmap(jax.random.fold_in, (None, 0))(key, np.array([_stable_int(name) for name in names], np.uint32))
    )


def trial_key(seed: int | jax.Array, purpose: str) -> jax.Array:
    """Return the root key of a trial for one purpose.

    Training's and evaluation's keys come from different streams of the same seed, so that no evaluation can
    meet a state that training has drawn.
    """
    return stream(jax.random.key(seed), purpose)
