"""Environment steps per second of PPO on 6-parity: our loop against `brax.training.agents.ppo.train`, interleaved.

    python benchmarks/ppo_against_brax.py [--rounds 3] [--steps 20]

Same networks, batch, environments and hyperparameters (the paper's), one trial, one device. Brax's own `train` runs
unchanged; jax 0.10 and later lack `device_put_replicated`, which it calls once at the start, so that name is given back
here. Compilation is left out on both sides: each is warmed up, and Brax's rate is the one that it reports itself.

The floor of both is the loss: per environment step `updates_per_batch` forward and backward passes through policy and
value network, and one more forward pass of the value network for the bootstrap.
"""

from __future__ import annotations

import argparse
import statistics
import time
from typing import Any

from evoclaims.trials import devices

devices.configure()

import jax  # noqa: E402
import jax.numpy as jnp  # noqa: E402
from brax.envs.base import Env, State  # noqa: E402
from brax.training.agents.ppo import networks, train  # noqa: E402

from evoclaims.envs.gates.parity import NParity  # noqa: E402
from evoclaims.methods.ppo import Ppo  # noqa: E402
from evoclaims.trials.budget import Budget  # noqa: E402
from evoclaims.trials.lanes import Lanes  # noqa: E402
from evoclaims.trials.spec import Condition  # noqa: E402


class ParityEnv(Env):
    """6-parity, one random row an episode, as a Brax environment."""

    task = NParity(bits=6, sampling="sampled")
    observation_size = task.observation_size
    action_size = task.action_size
    backend = "none"

    def reset(self, rng: jax.Array) -> State:
        """Ask a random row of the last level."""
        state = self.task.reset(rng, jnp.int32(self.task.levels - 1))
        return State(state, state.observation, jnp.zeros(()), jnp.zeros(()), {}, {})

    def step(self, state: State, action: jax.Array) -> State:
        """Answer it; every episode ends after one step."""
        after = self.task.step(state.pipeline_state, action)
        return state.replace(
            pipeline_state=after, obs=after.observation, reward=after.reward, done=after.terminated.astype(jnp.float32)
        )


def brax_rate(ppo: Ppo, steps: int) -> float:
    """Return the environment steps per second that Brax's `train` reports for its second epoch."""
    rates: list[float] = []

    def note(_: int, metrics: dict[str, Any]) -> None:
        if "training/sps" in metrics:
            rates.append(float(metrics["training/sps"]))

    train.train(
        environment=ParityEnv(),
        num_timesteps=2 * steps * ppo.cost(ParityEnv.task),
        num_evals=3,
        episode_length=1,
        num_envs=ppo.environments,
        unroll_length=ppo.unroll_length,
        batch_size=ppo.batch_size,
        num_minibatches=ppo.minibatches,
        num_updates_per_batch=ppo.updates_per_batch,
        learning_rate=ppo.learning_rate,
        entropy_cost=ppo.entropy_cost,
        discounting=ppo.discounting,
        normalize_observations=ppo.normalize_observations,
        network_factory=lambda *args, **kwargs: networks.make_ppo_networks(
            *args,
            **kwargs,
            policy_hidden_layer_sizes=ppo.policy_layers,
            value_hidden_layer_sizes=ppo.value_layers,
        ),
        max_devices_per_host=1,
        num_eval_envs=128,
        progress_fn=note,
    )
    return rates[-1]


class Ours:
    """The compiled program of one trial."""

    def __init__(self, ppo: Ppo) -> None:
        """Compile and warm up."""
        condition = Condition(ppo, ParityEnv.task, "direct", Budget(environment_steps=10**12))
        self.cost = ppo.cost(ParityEnv.task)
        self.lanes = Lanes(condition, jax.devices()[:1])
        self.state = self.lanes.start([0], 1)
        self.done = 0
        self.rate(2)

    def rate(self, steps: int) -> float:
        """Return environment steps per second over `steps` training steps."""
        self.done += steps
        began = time.perf_counter()
        self.state, report = self.lanes.advance(self.state, self.done, 1)
        took = time.perf_counter() - began
        if int(report.steps[0]) < self.done:
            raise SystemExit("The trial has solved the task; take another seed or fewer steps.")
        return steps * self.cost / took


def main() -> None:
    """Measure in turns and print the ratio."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--steps", type=int, default=20, help="training steps (65,536 environment steps) a round")
    options = parser.parse_args()
    if not hasattr(jax, "device_put_replicated"):
        jax.device_put_replicated = lambda tree, targets: jax.tree.map(lambda x: jnp.stack([x] * len(targets)), tree)
    ppo = Ppo()
    ours = Ours(ppo)
    rows = []
    for _ in range(options.rounds):
        rows.append((ours.rate(options.steps), brax_rate(ppo, options.steps)))
        print(f"ours {rows[-1][0]:>10,.0f}/s   brax {rows[-1][1]:>10,.0f}/s   ratio {rows[-1][0] / rows[-1][1]:.2f}")
    print(f"median ratio {statistics.median(a / b for a, b in rows):.2f} on {jax.devices()[0].device_kind}")


if __name__ == "__main__":
    main()
