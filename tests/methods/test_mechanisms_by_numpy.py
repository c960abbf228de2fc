"""What observers compute beside NumPy: PPO's advantages as sums, and a CPPN's answer by recursion."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from evoclaims.methods.mechanisms import HyperNeatMechanisms, PpoMechanisms
from evoclaims.methods.mechanisms.gradients import Batch, _log_slope
from evoclaims.methods.mechanisms.substrates import placed
from evoclaims.networks.genome import Connections, Genome, Nodes

DISCOUNT, TRACE = 0.9, 0.8
FUNCTIONS = (np.tanh, lambda z: np.exp(-z * z), np.sin, np.abs, lambda z: z)


def test_advantages_are_sums_of_discounted_errors_up_to_the_end_of_an_episode() -> None:
    draw = np.random.default_rng(0)
    trajectories, time = 40, 5
    ends = draw.integers(0, 6, (trajectories, time))
    terminated, truncated = (ends == 0).astype(np.float32), (ends == 1).astype(np.float32)
    shown, following = draw.normal(size=(2, trajectories, time, 3)).astype(np.float32)
    reward = draw.normal(size=(trajectories, time)).astype(np.float32)
    kernel, bias = draw.normal(size=(3, 1)).astype(np.float32), np.float32([0.5])
    network = {"params": {"hidden_0": {"kernel": jnp.asarray(kernel), "bias": jnp.asarray(bias)}}}
    none: Any = jnp.zeros((trajectories, time))
    arrays = [jnp.asarray(one) for one in (shown, following, reward, terminated, truncated)]
    batch = Batch(arrays[0], arrays[1], none, none, *arrays[2:])
    found, missed = PpoMechanisms()._advantages(network, batch)
    for row in range(trajectories):
        values = [float(x @ kernel[:, 0] + bias[0]) for x in shown[row]]
        values.append(float(following[row, -1] @ kernel[:, 0] + bias[0]))
        errors = [
            0.0
            if truncated[row, t]
            else reward[row, t] + DISCOUNT * (1 - terminated[row, t]) * values[t + 1] - values[t]
            for t in range(time)
        ]

        def summed(start: int, row: int = row, errors: list[float] = errors) -> float:
            """The sum of (γλ)ᵏ δ from `start` on, up to the end of its episode."""
            total, factor = 0.0, 1.0
            for t in range(start, time):
                total += factor * errors[t]
                if terminated[row, t] or truncated[row, t]:
                    break
                factor *= DISCOUNT * TRACE
            return total

        for t in range(time):
            ended = terminated[row, t] or truncated[row, t]
            later = 0.0 if ended or t + 1 == time else DISCOUNT * summed(t + 1)
            np.testing.assert_allclose(found[row, t], errors[t] + later, rtol=1e-4, atol=1e-4)
            np.testing.assert_allclose(missed[row, t], summed(t), rtol=1e-4, atol=1e-4)


def test_weights_are_what_a_recursion_through_the_cppn_answers() -> None:
    """Node 7 is reached by none, and so is what only it leads to; keys 0 to 3 are inputs, 4 is the output."""
    keys, functions = [0, 1, 2, 3, 7, 5, 6, 4], [0, 0, 0, 0, 3, 2, 1, 0]
    links = {(0, 5): 1.5, (2, 5): -0.7, (5, 6): 0.9, (1, 6): 0.4, (7, 4): 5.0, (6, 4): 1.1, (3, 4): -0.8, (5, 4): 0.6}
    bias, response = np.linspace(-0.5, 0.6, 8), np.linspace(0.7, 1.3, 8)
    genome = Genome(
        Nodes(jnp.array(keys), jnp.float32(bias), jnp.float32(response), jnp.array(functions)),
        Connections(
            jnp.array([keys.index(one) for one, _ in links]),
            jnp.array([keys.index(other) for _, other in links]),
            jnp.float32(list(links.values())),
        ),
        jnp.array(8),
        jnp.array(len(links)),
    )

    def emitted(key: int, question: list[float]) -> float | None:
        if key < 4:
            return question[key]
        given = [(weight, emitted(one, question)) for (one, other), weight in links.items() if other == key]
        heard = [weight * value for weight, value in given if value is not None]
        if not heard:
            return None
        slot = keys.index(key)
        return float(FUNCTIONS[4 if key == 4 else functions[slot]](bias[slot] + response[slot] * sum(heard)))

    expected = []
    rows = [[(x, y) for x in np.linspace(-1, 1, width)] for width, y in ((4, -1), (3, 0), (2, 1))]
    for before, after in pairwise(rows):
        for target in after:
            for source in before:
                answer = np.tanh(emitted(4, [*source, *target]))
                size = max(abs(answer) - 0.3, 0) / 0.7 * 5
                expected.append(np.sign(answer) * size)
    found = HyperNeatMechanisms()._weights(placed((4, 3, 2)), genome)
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4)
    assert 0 < np.count_nonzero(expected) < len(expected)


def test_the_slope_of_tanh_has_a_logarithm_wherever_a_policy_may_act() -> None:
    """Cosh of 90 is beyond float32; a first policy with a large spread, seed 173 of a pilot, has acted so."""
    raw = np.array([-1e4, -90.0, -21.0, -19.0, -1.0, 0.0, 2.0, 20.5, 89.0, 300.0])
    exact = 2 * (np.log(2) - np.abs(raw) - np.log1p(np.exp(-2 * np.abs(raw))))
    found, gradient = jax.vmap(jax.value_and_grad(_log_slope))(jnp.asarray(raw, jnp.float32))
    np.testing.assert_allclose(found, exact, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(gradient, -2 * np.tanh(raw), rtol=1e-6)
