"""PPO in our loop against `brax.training.agents.ppo.train`: as fast, and the same algorithm to a statistician.

    python benchmarks/ppo_against_brax.py [--rounds 3] [--steps 20]     speed on 6-parity, interleaved
    python benchmarks/ppo_against_brax.py --learning 10                 success after training, 10 seeds a side

Same networks, batch, environments and hyperparameters (the paper's), one trial, one device. Brax's own `train` runs
unchanged; jax 0.10 and later lack `device_put_replicated`, which it calls once at the start, so that name is given back
here. Compilation is left out on both sides: each is warmed up, and Brax's rate is the one that it reports itself.

The floor of both is the loss: per environment step `updates_per_batch` forward and backward passes through policy and
value network, and one more forward pass of the value network for the bootstrap.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import Any

from evoclaims.trials import devices

devices.configure()

import jax  # noqa: E402
import jax.numpy as jnp  # noqa: E402
from brax.envs.base import Env, State  # noqa: E402
from brax.training.agents.ppo import networks, train  # noqa: E402

from evoclaims.envs.gates.parity import NParity  # noqa: E402
from evoclaims.judging.exact import rank_test  # noqa: E402
from evoclaims.methods.ppo import LevelTest, Ppo  # noqa: E402
from evoclaims.trials.lanes import Lanes  # noqa: E402
from evoclaims.trials.runner import run  # noqa: E402
from evoclaims.trials.spec import Budget, Condition  # noqa: E402
from evoclaims.trials.store import Store  # noqa: E402


class ParityEnv(Env):
    """N-parity, one random row an episode, as a Brax environment."""

    backend = "none"
    observation_size = 0
    action_size = 0

    def __init__(self, bits: int) -> None:
        """Choose the number of bits."""
        self.task = NParity(bits=bits, sampling="sampled")
        self.observation_size = self.task.observation_size
        self.action_size = self.task.action_size

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


def train_brax(ppo: Ppo, bits: int, steps: int, seed: int = 0, epochs: int = 1) -> tuple[Any, list[float]]:
    """Run Brax's own `train` for `epochs` × `steps` training steps.

    Returns:
        The deterministic policy, and the environment steps per second that Brax reports for each epoch.
    """
    rates: list[float] = []

    def note(_: int, metrics: dict[str, Any]) -> None:
        if "training/sps" in metrics:
            rates.append(float(metrics["training/sps"]))

    environment = ParityEnv(bits)
    make_policy, parameters, _ = train.train(
        environment=environment,
        num_timesteps=epochs * steps * ppo.cost(environment.task),
        num_evals=epochs + 1,
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
        network_factory=partial(
            networks.make_ppo_networks,
            policy_hidden_layer_sizes=ppo.policy_layers,
            value_hidden_layer_sizes=ppo.value_layers,
        ),
        max_devices_per_host=1,
        num_eval_envs=128,
        seed=seed,
        progress_fn=note,
    )
    return make_policy(parameters, deterministic=True), rates


def compare_learning(seeds: int, steps: int = 100, bits: int = 4) -> None:
    """Print both sides' success on 4-parity after the same number of training steps, and an exact two-sided p."""
    never = LevelTest(every=10**9)  # no level-up, so that no trial ends early
    ppo = Ppo(environments=256, batch_size=256, minibatches=8, learning_rate=3e-3, level_test=never)
    task = ParityEnv(bits).task
    budget = Budget(environment_steps=steps * ppo.cost(task), reports=1)
    with tempfile.TemporaryDirectory() as folder:
        trials = run(Condition(ppo, task, "direct", budget), range(seeds), Store(Path(folder)), devices.choose("cpu"))
    ours = [trial.metrics["last_success"] for trial in trials]
    last = jnp.int32(task.levels - 1)
    theirs = []
    for seed in range(seeds):
        policy, _ = train_brax(ppo, bits, steps, seed)
        examined = task.examine(lambda x, policy=policy: policy(x, jax.random.key(0))[0], jax.random.key(0), last)
        theirs.append(float(examined.success))
    p = min(1.0, 2 * min(rank_test(ours, theirs).p, rank_test(theirs, ours).p))
    print(f"success on {bits}-parity after {steps * ppo.cost(task):,} environment steps")
    print("  ours ", sorted(ours))
    print("  brax ", sorted(theirs))
    print(f"  exact rank test, two-sided: p = {p:.3f} (n = {seeds} a side)")


class Ours:
    """The compiled program of one trial."""

    def __init__(self, ppo: Ppo) -> None:
        """Compile and warm up."""
        task = ParityEnv(6).task
        condition = Condition(ppo, task, "direct", Budget(environment_steps=10**12))
        self.cost = ppo.cost(task)
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
    parser.add_argument("--learning", type=int, metavar="SEEDS", help="compare what is learned instead of the speed")
    options = parser.parse_args()
    if not hasattr(jax, "device_put_replicated"):
        jax.device_put_replicated = lambda tree, targets: jax.tree.map(lambda x: jnp.stack([x] * len(targets)), tree)
    if options.learning:
        compare_learning(options.learning)
        return
    ppo = Ppo()
    ours = Ours(ppo)
    rows = []
    for _ in range(options.rounds):
        rows.append((ours.rate(options.steps), train_brax(ppo, 6, options.steps, epochs=2)[1][-1]))
        print(f"ours {rows[-1][0]:>10,.0f}/s   brax {rows[-1][1]:>10,.0f}/s   ratio {rows[-1][0] / rows[-1][1]:.2f}")
    print(f"median ratio {statistics.median(a / b for a, b in rows):.2f} on {jax.devices()[0].device_kind}")


if __name__ == "__main__":
    main()
