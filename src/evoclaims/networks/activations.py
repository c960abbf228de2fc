"""The activation functions that a node gene may carry, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from evoclaims.core.errors import require_known

ACTIVATIONS: Mapping[str, Callable[[Array], Array]] = MappingProxyType(
    {
        "tanh": jnp.tanh,
        "sigmoid": jax.nn.sigmoid,
        "sin": jnp.sin,
        "gauss": lambda z: jnp.exp(-z * z),
        "abs": jnp.abs,
        "identity": lambda z: z,
    }
)


def check_activations(names: Sequence[str]) -> None:
    """Raise an `UnknownNameError`, which lists the known names, for any other name."""
    for name in names:
        require_known("activation function", name, ACTIVATIONS)


def apply_activation(
    names: Sequence[str], index: Int[Array, "*slots"], z: Float[Array, "*shape"]
) -> Float[Array, "*shape"]:
    """Apply function `names[index]` to each element of `z`; `index` broadcasts against `z`.

    All functions of the set are computed and one is kept, as sets are small.
    """
    value = ACTIVATIONS[names[0]](z)
    for i, name in enumerate(names[1:], start=1):
        value = jnp.where(index == i, ACTIVATIONS[name](z), value)
    return value
