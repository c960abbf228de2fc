"""Named streams of random keys: each use has a name, and a new name changes no other stream."""

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
    """Derive the key (typed, shape []) for the use called `name`."""
    return jax.random.fold_in(key, _stable_int(name))


def streams(key: jax.Array, *names: str) -> tuple[jax.Array, ...]:
    """Return one key per name.

    `mutate_key, eval_key = streams(key, "mutate", "eval")`
    """
    # The same keys as separate calls of `stream`, but only one generator call to compile.
    return tuple(
        jax.vmap(jax.random.fold_in, (None, 0))(key, np.array([_stable_int(name) for name in names], np.uint32))
    )


def trial_key(seed: int | jax.Array, purpose: str) -> jax.Array:
    """Return the root key of a trial for one purpose.

    Training and evaluation keys come from different streams of the same seed, so evaluation never reuses a state
    drawn in training.
    """
    return stream(jax.random.key(seed), purpose)
