"""One update of PPO with robots, by the precision of its matrix products: what does full float32 cost?

    python benchmarks/ppo_update.py [--trials 10] [--updates 100] [--rounds 5]

An update is the gradient of Brax's loss on one minibatch (2,048 trajectories of 5 steps) and Adam's step, for ten
trials at once, with the published value network (5 x 256) and the paper's policy (4 x 32), on drawn data of the
half-cheetah's sizes. The engine asks for full float32 ("highest"). "tensorfloat32" rounds the factors to 10 bits on a
GPU; "TF32_TF32_F32_X3" makes three such products of one. Each gradient is compared with full float32's. A processor has
no TF32: there all are full float32, or refused.

The floor: an update has trials x 2,048 x (5 x 6 x (268,289 + 4,172) + 2 x 268,289) floating-point operations.
"""

from __future__ import annotations

import argparse
import math
import statistics
import time
from functools import partial
from typing import Any

from evoclaims.trials import devices

devices.configure()

import jax  # noqa: E402
import jax.numpy as jnp  # noqa: E402
import optax  # noqa: E402
from brax.training.types import Transition  # noqa: E402

from evoclaims.methods.collect import losses, networks, running_statistics, specs  # noqa: E402

PRECISIONS = ("highest", "TF32_TF32_F32_X3", "tensorfloat32")
TRAJECTORIES, STEPS, OBSERVATION, ACTION = 2_048, 5, 18, 6
LOSS = {
    "entropy_cost": 1e-2,
    "discounting": 0.97,
    "reward_scaling": 10.0,
    "gae_lambda": 0.95,
    "clipping_epsilon": 0.3,
}


def trajectories(key: jax.Array) -> Transition:
    """Draw a minibatch (leaves [trajectories, steps, ...])."""
    shape = (TRAJECTORIES, STEPS)
    seen, then, acted, paid = jax.random.split(key, 4)
    action = jax.random.normal(acted, (*shape, ACTION))
    policy = {
        "raw_action": action,
        "log_prob": jnp.full(shape, -6.0),
        "distribution_params": jnp.zeros((*shape, 2 * ACTION)),
    }
    return Transition(
        observation=jax.random.normal(seen, (*shape, OBSERVATION)),
        action=jnp.tanh(action),
        reward=jax.random.normal(paid, shape),
        discount=jnp.ones(shape),
        next_observation=jax.random.normal(then, (*shape, OBSERVATION)),
        extras={"state_extras": {"truncation": jnp.zeros(shape)}, "policy_extras": policy},
    )


def main() -> None:
    """Measure the precisions in turns."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--trials", type=int, default=10)
    parser.add_argument("--updates", type=int, default=100, help="in one call")
    parser.add_argument("--rounds", type=int, default=5)
    asked = parser.parse_args()
    net = networks.make_ppo_networks(
        OBSERVATION,
        ACTION,
        preprocess_observations_fn=running_statistics.normalize,
        policy_hidden_layer_sizes=(32,) * 4,
        value_hidden_layer_sizes=(256,) * 5,
    )
    whitening = running_statistics.init_state(specs.Array((OBSERVATION,), jnp.dtype("float32")))
    loss = partial(losses.compute_ppo_loss, ppo_network=net, **LOSS)
    adam = optax.adam(3e-4)

    def start(key: jax.Array) -> Any:
        one, other = jax.random.split(key)
        return losses.PPONetworkParams(policy=net.policy_network.init(one), value=net.value_network.init(other))

    def gradient(parameters: Any, data: Transition, key: jax.Array) -> Any:
        return jax.grad(loss, has_aux=True)(parameters, whitening, data, key)[0]

    def updated(parameters: Any, data: Transition, key: jax.Array) -> Any:
        def descend(carry: tuple[Any, Any], key: jax.Array) -> tuple[tuple[Any, Any], None]:
            parameters, optimizer = carry
            update, optimizer = adam.update(gradient(parameters, data, key), optimizer)
            return (optax.apply_updates(parameters, update), optimizer), None

        keys = jax.random.split(key, asked.updates)
        return jax.lax.scan(descend, (parameters, adam.init(parameters)), keys)[0][0]

    keys = jax.random.split(jax.random.key(0), asked.trials)
    arguments = (jax.vmap(start)(keys), jax.vmap(trajectories)(keys), keys)
    programs, gradients = {}, {}
    for precision in PRECISIONS:
        with jax.default_matmul_precision(precision):
            try:
                programs[precision] = jax.jit(jax.vmap(updated)).lower(*arguments).compile()
                gradients[precision] = jax.jit(jax.vmap(gradient))(*arguments)
            except ValueError as error:
                print(f"{precision}: {error}")
    for program in programs.values():
        jax.block_until_ready(program(*arguments))
    seconds: dict[str, list[float]] = {precision: [] for precision in programs}
    for _ in range(asked.rounds):
        for precision, program in programs.items():
            began = time.perf_counter()
            jax.block_until_ready(program(*arguments))
            seconds[precision].append((time.perf_counter() - began) / asked.updates)
    once = asked.trials * TRAJECTORIES * (STEPS * 6 * (268_289 + 4_172) + 2 * 268_289)
    for precision, took in seconds.items():
        each = statistics.median(took)
        pairs = zip(jax.tree.leaves(gradients[precision]), jax.tree.leaves(gradients["highest"]), strict=True)
        squares = [(float(jnp.sum((ours - exact) ** 2)), float(jnp.sum(exact**2))) for ours, exact in pairs]
        off = math.sqrt(sum(error for error, _ in squares) / sum(size for _, size in squares))
        print(
            f"{precision}: {each * 1e3:.2f} ms an update, {once / each / 1e12:.1f} TFLOP/s, gradient off by {off:.1e}"
        )


if __name__ == "__main__":
    main()
