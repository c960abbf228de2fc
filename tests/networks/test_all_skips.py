"""The all-skips network against loops over neurons in float64."""

from __future__ import annotations

import functools
from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.typing import NDArray

from evoclaims.core.errors import UserError
from evoclaims.networks.all_skips import AllSkips, scanned, unrolled

pytestmark = pytest.mark.newest

SIZES = [(1, 0, 1), (2, 1, 1), (6, 24, 1), (8, 5, 4), (3, 7, 2)]
sizes = pytest.mark.parametrize(("inputs", "hidden", "outputs"), SIZES)


def _loops(parameters: NDArray[np.float64], observation: NDArray[np.float64], hidden: int, outputs: int) -> list[float]:
    """Fire one neuron after the other, taking the parameters in the order that the class documents."""
    left = iter(parameters.tolist())
    feed = [[next(left) for _ in range(len(observation) + 1)] for _ in range(hidden + outputs)]
    readout = [[next(left) for _ in range(hidden)] for _ in range(outputs)]
    between = [[next(left) for _ in range(neuron)] for neuron in range(hidden)]
    assert list(left) == []
    fired: list[float] = []
    for neuron in range(hidden + outputs):
        weights = between[neuron] if neuron < hidden else readout[neuron - hidden]
        potential = feed[neuron][-1]
        potential += sum(weight * x for weight, x in zip(feed[neuron][:-1], observation, strict=True))
        potential += sum(weight * x for weight, x in zip(weights, fired[:hidden], strict=True))
        fired.append(float(np.tanh(potential)))
    return fired[hidden:]


@functools.cache
def _apply(hidden: int, outputs: int) -> Callable[[jax.Array, jax.Array], jax.Array]:
    return jax.jit(lambda parameters, observation: AllSkips(hidden).apply(parameters, observation, outputs))


def _drawn(inputs: int, hidden: int, outputs: int, seed: int = 0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return parameters and an observation."""
    draw = np.random.default_rng(seed)
    return draw.normal(size=AllSkips(hidden).size(inputs, outputs)), draw.normal(size=inputs)


@sizes
def test_it_computes_what_loops_over_neurons_compute(inputs: int, hidden: int, outputs: int) -> None:
    for seed in range(3):
        parameters, observation = _drawn(inputs, hidden, outputs, seed)
        answer = _apply(hidden, outputs)(jnp.float32(parameters), jnp.float32(observation))
        assert answer.shape == (outputs,)
        assert answer.dtype == jnp.float32
        np.testing.assert_allclose(answer, _loops(parameters, observation, hidden, outputs), atol=1e-5)


def test_the_papers_network_on_6_parity_has_475_parameters() -> None:
    assert AllSkips(24).size(6, 1) == 24 * 7 + 24 * 23 // 2 + 7 + 24


def _in_a_loop(function: Any, parameters: Any, observation: Any) -> Any:
    """Return the answers to observations that need the answer before."""

    def step(observation: Any, _: None) -> Any:
        answer = function(parameters, observation)
        return 0.5 * observation + 0.1 * jnp.resize(answer, observation.shape), answer

    return jax.lax.scan(step, observation, None, length=4)[1]


BATCHED: dict[str, Callable[[Any], Any]] = {
    "individuals": lambda function: jax.vmap(jax.vmap(function)),
    "observations of each individual": lambda function: jax.vmap(jax.vmap(function, (None, 0)), (0, None)),
    "episodes of individuals": lambda function: jax.vmap(jax.vmap(partial(_in_a_loop, function))),
}


def _ways(hidden: int, outputs: int, batched: Callable[[Any], Any]) -> tuple[Any, Any, Any]:
    """Return the network, its loop, and what GPUs compute; all for batches."""
    network = AllSkips(hidden)
    of_network = batched(lambda parameters, observation: network.apply(parameters, observation, outputs))
    return of_network, *(batched(partial(way, hidden, outputs)) for way in (scanned, unrolled))


def _batches(inputs: int, hidden: int, outputs: int, case: str) -> tuple[jax.Array, jax.Array]:
    """Return parameters and observations for a case."""
    draw = np.random.default_rng(0)
    individuals = (3,) if case.startswith("observations") else (2, 3)
    parameters = draw.normal(size=(*individuals, AllSkips(hidden).size(inputs, outputs))) / 2
    return jnp.float32(parameters), jnp.float32(draw.normal(size=(*individuals[:2], inputs)))


@pytest.mark.parametrize("case", BATCHED)
@pytest.mark.parametrize(("inputs", "hidden", "outputs"), [(1, 0, 1), (3, 2, 1), (6, 24, 2)])
def test_batched_and_in_loops_every_way_computes_the_same(inputs: int, hidden: int, outputs: int, case: str) -> None:
    network, loop, other = (jax.jit(way) for way in _ways(hidden, outputs, BATCHED[case]))
    given_ = _batches(inputs, hidden, outputs, case)
    expected = loop(*given_)
    np.testing.assert_array_equal(network(*given_), expected)  # a processor's bits are those of the loop
    np.testing.assert_allclose(other(*given_), expected, atol=1e-5)


@pytest.mark.parametrize("case", BATCHED)
def test_a_processors_program_is_the_loop_and_a_gpus_has_no_loop(case: str) -> None:
    network, loop, _ = (jax.jit(way) for way in _ways(24, 2, BATCHED[case]))
    traced, of_loop = (way.trace(*_batches(6, 24, 2, case)) for way in (network, loop))
    assert _text(traced, "cpu") == _text(of_loop, "cpu")
    steps = case.startswith("episodes")
    assert _text(traced, "cpu").count("stablehlo.while") == 1 + steps
    assert _text(traced, "cuda").count("stablehlo.while") == steps
    assert "stablehlo.scatter" in _text(traced, "cpu")
    assert "stablehlo.scatter" not in _text(traced, "cuda")


def _text(traced: Any, platform: str) -> str:
    """Return a program as jax gives it to XLA, without its name."""
    text: str = traced.lower(lowering_platforms=(platform,)).as_text()
    return text.partition("\n")[2]


def test_a_negative_number_of_neurons_is_one_sentence() -> None:
    with pytest.raises(UserError, match="AllSkips has hidden=-1"):
        AllSkips(-1)
