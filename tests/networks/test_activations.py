"""Activation functions by name and by index."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from evoclaims.core.errors import UnknownNameError
from evoclaims.networks.activations import ACTIVATIONS, check_activations

Z = np.array([-100.0, -2.0, -0.5, 0.0, 0.5, 2.0, 100.0])
WANTED = {
    "tanh": np.tanh(Z),
    "sigmoid": 1 / (1 + np.exp(-Z)),
    "sin": np.sin(Z),
    "gauss": np.exp(-(Z**2)),
    "abs": np.abs(Z),
    "identity": Z,
}


@pytest.mark.parametrize("name", ACTIVATIONS)
def test_a_function_is_what_its_name_says(name: str) -> None:
    value = ACTIVATIONS[name](jnp.float32(Z))
    assert value.dtype == jnp.float32
    np.testing.assert_allclose(value, WANTED[name], rtol=1e-5, atol=1e-6)


def test_an_unknown_function_is_one_sentence_with_the_known_ones() -> None:
    check_activations(tuple(ACTIVATIONS))
    with pytest.raises(UnknownNameError, match="activation function.*relu6.*tanh"):
        check_activations(("tanh", "relu6"))
