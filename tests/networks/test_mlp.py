"""Perceptrons against loops over neurons in float64."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.typing import NDArray

from evoclaims.core.errors import UserError
from evoclaims.networks.base import Bound
from evoclaims.networks.mlp import Mlp

SHAPES = [(2, (), 1), (3, (4,), 2), (6, (5, 3, 2), 1), (8, (32, 32, 32, 32), 4)]
shapes = pytest.mark.parametrize(("inputs", "layers", "outputs"), SHAPES)
skips = pytest.mark.parametrize("skip", [False, True], ids=["dense", "skip"])


def _loops(
    parameters: NDArray[np.float64], observation: NDArray[np.float64], widths: tuple[int, ...], skip: bool
) -> list[float]:
    """Fire layer after layer, taking the parameters in the order that the class documents."""
    left = iter(parameters.tolist())
    signal = observation.tolist()
    for depth, width in enumerate(widths):
        weights = [[next(left) for _ in signal] for _ in range(width)]
        biases = [next(left) for _ in range(width)]
        potentials = [
            bias + sum(weight * x for weight, x in zip(row, signal, strict=True))
            for row, bias in zip(weights, biases, strict=True)
        ]
        if skip and depth == len(widths) - 1:
            for neuron in range(width):
                potentials[neuron] += sum(next(left) * x for x in observation)
        signal = [float(np.tanh(potential)) for potential in potentials]
    assert list(left) == []
    return signal


@shapes
@skips
def test_it_computes_what_loops_over_neurons_compute(
    inputs: int, layers: tuple[int, ...], outputs: int, skip: bool
) -> None:
    network = Mlp(layers, skip)
    apply = jax.jit(lambda parameters, observation: network.apply(parameters, observation, outputs))
    for seed in range(3):
        draw = np.random.default_rng(seed)
        parameters, observation = draw.normal(size=network.size(inputs, outputs)), draw.normal(size=inputs)
        answer = apply(jnp.float32(parameters), jnp.float32(observation))
        assert answer.shape == (outputs,)
        assert answer.dtype == jnp.float32
        np.testing.assert_allclose(answer, _loops(parameters, observation, (*layers, outputs), skip), atol=2e-5)


@pytest.mark.parametrize("extra", [-1, 1])
def test_parameters_of_another_network_are_a_sentence_with_both_numbers(extra: int) -> None:
    right = Mlp((4,)).size(3, 2)
    said = f"was given {right + extra} parameters. From 3 inputs to 2 outputs it takes {right}, the number"
    with pytest.raises(UserError, match=said):
        jax.jit(lambda x: Mlp((4,)).apply(jnp.zeros(right + extra), x, 2))(jnp.zeros(3))


def test_an_empty_layer_is_one_sentence() -> None:
    with pytest.raises(UserError, match=r"has layers=\(4, 0\)"):
        Mlp((4, 0))


def test_a_network_with_its_parameters_is_a_function_to_jax() -> None:
    network = Mlp([4])  # type: ignore[arg-type]  # a list of widths is as good
    assert network == Mlp((4,))
    parameters = jax.random.normal(jax.random.key(0), (network.size(3, 2),))
    policy, observation = Bound(network, parameters, 2), jnp.ones(3)
    wanted = network.apply(parameters, observation, 2)
    np.testing.assert_allclose(jax.jit(policy)(observation), wanted, rtol=1e-6)
    np.testing.assert_allclose(jax.lax.cond(True, policy, policy, observation), wanted, rtol=1e-6)
