"""CMA-ES's network with robots, computed by a loop over its neurons and without one, in turns.

`python benchmarks/all_skips.py [--robots 2560] [--inputs 34] [--outputs 8]`, on a GPU or a processor. Each robot has
parameters of its own. A step's observation is made of the last step's outputs, so that nothing leaves the loop over
steps; that loop alone, without a network, is measured, too.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from functools import partial
from typing import Any

from evoclaims.trials.devices import MATMUL_PRECISION, configure

configure()

import jax  # noqa: E402
import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402

from evoclaims.networks.all_skips import AllSkips, scanned, unrolled  # noqa: E402

Forward = Callable[[Any, Any], Any]


def steps_of(forward: Forward, parameters: Any, inputs: int, outputs: int, steps: int) -> Callable[[], Any]:
    """Return a compiled function that makes `steps` steps and returns the last outputs, [robots, outputs]."""
    robots = parameters.shape[0]
    shift = jnp.arange(inputs) / inputs

    def step(answer: Any, _: None) -> tuple[Any, None]:
        observation = jnp.sin(jnp.sum(answer, axis=1, keepdims=True) + shift)
        return jax.vmap(forward)(parameters, observation), None

    def run(parameters: Any) -> Any:
        return jax.lax.scan(step, jnp.zeros((robots, outputs)), None, length=steps)[0]

    compiled = jax.jit(run).lower(parameters).compile()
    return lambda: jax.block_until_ready(compiled(parameters))


def main() -> None:
    """Measure in turns and print medians."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--robots", type=int, default=2560)
    parser.add_argument("--hidden", type=int, default=24)
    parser.add_argument("--inputs", type=int, default=34, help="34 sensors and 8 motors: the ant among stones")
    parser.add_argument("--outputs", type=int, default=8)
    parser.add_argument("--steps", type=int, default=1000)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    size = AllSkips(hidden=options.hidden).size(options.inputs, options.outputs)
    parameters = jnp.asarray(np.random.default_rng(0).normal(scale=0.1, size=(options.robots, size)), jnp.float32)
    ways: dict[str, Forward] = {
        "no network": lambda parameters, observation: observation[: options.outputs] * parameters[0],
        "a loop": partial(scanned, options.hidden, options.outputs),
        "no loop": partial(unrolled, options.hidden, options.outputs),
    }
    print(f"jax {jax.__version__}, {jax.devices()[0].device_kind}: {options.robots} robots, {size} parameters each")
    with jax.default_matmul_precision(MATMUL_PRECISION):
        runs = {
            name: steps_of(forward, parameters, options.inputs, options.outputs, options.steps)
            for name, forward in ways.items()
        }
    for run in runs.values():
        run()
    took: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(options.rounds):
        for name, run in runs.items():
            began = time.perf_counter()
            run()
            took[name].append((time.perf_counter() - began) / options.steps)
    for name, seconds in took.items():
        print(f"  {name}: {1e6 * statistics.median(seconds):.1f} µs a step")
    observations = jnp.sin(jnp.arange(options.robots * options.inputs).reshape(options.robots, options.inputs) * 1.0)
    loop, none = (jax.jit(jax.vmap(ways[name]))(parameters, observations) for name in ("a loop", "no loop"))
    print(f"  largest difference of an output: {jnp.abs(loop - none).max():.1e}")


if __name__ == "__main__":
    main()
