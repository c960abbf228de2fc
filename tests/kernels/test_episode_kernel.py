"""A whole episode as one kernel of a GPU is what its steps are one by one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from assembler import assemble, kernels_for_gpus
from block_machine import run_episodes

from evoclaims.envs.base import played
from evoclaims.envs.ecorobot import robot_task
from evoclaims.envs.ecorobot.stones import SteppingStones
from evoclaims.kernels import in_one_kernel
from evoclaims.kernels.call import episode
from evoclaims.kernels.emit import gpu_kernel
from evoclaims.kernels.emit.episode_kernel import Perceptron, episodes_of_a_block
from evoclaims.networks.base import Bound
from evoclaims.networks.mlp import Mlp

STEPS = 5
TRIALS, POPULATION = 2, 3
SIZES = {"no hidden layer": (3, (), 2), "two of them": (10, (32, 32), 4), "wider than a warp": (5, (40, 7), 34)}


def _step(state: Any, action: Any, constants: Any) -> Any:
    """Turn what is seen round, twice a step, until it is beyond a bound."""
    seen, count, going, nothing = state
    push = jnp.mean(action * jnp.arange(1.0, action.shape[0] + 1)) * constants["gain"]

    def turn(x: Any, _: None) -> Any:
        return jnp.roll(x, 1) * 0.9 + push, None

    moved = jax.lax.scan(turn, seen, None, length=2)[0]
    going = going & (jnp.abs(moved[0]) < constants["bound"][1])
    return jnp.where(going, moved, seen), count + going.astype(jnp.int32), going, nothing


def _played(network: Mlp, inputs: int, outputs: int) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Return episodes of two trials' populations, step by step and as `in_one_kernel` returns them."""

    def play(state: Any, parameters: Any, constants: Any) -> Any:
        for _ in range(STEPS):
            state = _step(state, network.apply(parameters, state[0], outputs), constants)
        return state

    kernel = in_one_kernel(play, _step, STEPS, (inputs, *network.layers, outputs), "This episode")
    of_trials = {"bound": 0, "gain": None}
    one, other = (jax.vmap(jax.vmap(f, (0, 0, None)), (0, 0, of_trials)) for f in (play, kernel))
    return one, other


def _arguments(network: Mlp, inputs: int, outputs: int) -> Any:
    rng = np.random.default_rng(0)

    def numbers(*shape: int) -> Any:
        return jnp.asarray(rng.normal(size=(TRIALS, POPULATION, *shape)), jnp.float32)

    state = numbers(inputs), jnp.ones((TRIALS, POPULATION), jnp.int32), numbers() < 2, numbers(0)
    constants = {"bound": jnp.array([[0.0, 100.0], [0.0, 0.5]]), "gain": jnp.float32(0.3)}
    return state, numbers(network.size(inputs, outputs)), constants


@pytest.fixture
def on_threads(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Have a GPU's kernels run by threads of this processor; the programs that ran are in the list."""
    texts: list[str] = []
    programs: list[Any] = []
    write = episode.episode_kernel.text

    def text(*given: Any) -> str:
        texts.append(write(*given))
        return texts[-1]

    def on_gpu(program: Any, operands: Any, shapes: Any, elements: int) -> list[Any]:
        programs.append(program)
        made = run_episodes(texts[-1], program, elements, list(map(np.asarray, operands)), shapes)
        return list(map(jnp.asarray, made))

    monkeypatch.setattr(episode.episode_kernel, "text", text)
    monkeypatch.setattr(episode.calls, "on_gpu", on_gpu)
    monkeypatch.setattr(episode, "processors_and_memory", lambda: (2, 227 * 1024))
    alone = episode.calls.CALL.impl  # the call outside of compiled programs, of a whole batch

    def call(*leaves: Any, kernel: Any) -> Any:
        return kernel.on_gpu(*leaves) if isinstance(kernel, episode.EpisodeKernel) else alone(*leaves, kernel=kernel)

    monkeypatch.setattr(episode.calls.CALL, "impl", call)
    return programs


@pytest.mark.oldest
@pytest.mark.parametrize("name", SIZES)
def test_an_episode_is_what_its_steps_are_one_by_one(name: str, on_threads: list[Any]) -> None:
    inputs, layers, outputs = SIZES[name]
    network = Mlp(layers)
    one_by_one, in_kernel = _played(network, inputs, outputs)
    arguments = _arguments(network, inputs, outputs)
    wanted, made = one_by_one(*arguments), in_kernel(*arguments)
    assert [program.elements for program in on_threads] == [4]  # the second block has two that do not exist
    for a, b in zip(jax.tree.leaves(wanted), jax.tree.leaves(made), strict=True):
        np.testing.assert_allclose(a, b, atol=2e-5)
    assert 0 < np.mean(made[2]) < 1, np.asarray(made[2])  # some went on to the end, and some did not


@pytest.mark.oldest
def test_a_robots_episode_is_what_its_steps_are_one_by_one(on_threads: list[Any]) -> None:
    task, network, count = SteppingStones(episode_steps=4), Mlp((8,)), 3
    start = jax.vmap(task.reset, (0, None))(jax.random.split(jax.random.key(0), count), jnp.int32(0))
    size = network.size(task.observation_size, task.action_size)
    parameters = jax.random.normal(jax.random.key(1), (count, size))
    policy = jax.vmap(lambda vector, begun: task._played(Bound(network, vector, task.action_size), begun))
    by_steps = jax.jit(
        jax.vmap(lambda vector, begun: played(task, Bound(network, vector, task.action_size), begun)[:2])
    )
    wanted, made = by_steps(parameters, start), policy(parameters, start)
    assert len(on_threads) == 1
    for a, b in zip(jax.tree.leaves(wanted), jax.tree.leaves(made), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-4, atol=1e-4)
    assert (np.asarray(made[0].inner.time) == 4).all()


def test_trials_on_a_gpu_play_in_one_kernel(tmp_path: Path) -> None:
    inputs, layers, outputs = SIZES["two of them"]
    network = Mlp(layers)
    (ptx,) = kernels_for_gpus(_played(network, inputs, outputs)[1], *_arguments(network, inputs, outputs))
    assert ".entry this_episode(" in ptx
    assemble(ptx, tmp_path)


def test_a_step_that_several_warps_would_share_is_a_kernel_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    inputs, layers, outputs = SIZES["two of them"]
    network = Mlp(layers)
    monkeypatch.setattr(gpu_kernel, "SMALL", 10)
    assert kernels_for_gpus(_played(network, inputs, outputs)[1], *_arguments(network, inputs, outputs)) == []


class Slow(SteppingStones):
    """Takes half of what the policy says."""

    def step(self, state: Any, action: Any) -> Any:
        """Act."""
        return super().step(state, action / 2)


class Doubled(Mlp):
    """Says twice what a perceptron does."""

    def apply(self, parameters: Any, observation: Any, outputs: int) -> Any:
        """Act."""
        return 2 * super().apply(parameters, observation, outputs)


def test_tasks_with_steps_of_their_own_and_other_networks_are_played_step_by_step() -> None:
    cases = (SteppingStones, Mlp((8,)), 1), (Slow, Mlp((8,)), 0), (SteppingStones, Mlp((8,), skip=True), 0)
    for kind, network, kernels in (*cases, (SteppingStones, Doubled((8,)), 0)):
        task = kind(episode_steps=2)
        policy = Bound(network, jnp.zeros(network.size(task.observation_size, task.action_size)), task.action_size)
        traced = jax.make_jaxpr(lambda key, task=task, policy=policy: task.episode(policy, key, jnp.int32(0)))
        calls = [e for e in traced(jax.random.key(0)).eqns if e.primitive.name == "kernel"]
        names = [e.params["kernel"].name for e in calls]
        assert names.count("An episode of stepping_stones") == kernels, names


def test_a_block_plays_as_many_episodes_as_use_all_processors_and_as_its_memory_holds() -> None:
    network = Perceptron((10, 32, 32, 32, 32, 4))
    assert network.size == 3652
    memory = 227 * 1024
    assert [episodes_of_a_block(network, rows, 132, memory) for rows in (1, 132, 133, 1000, 1056, 1057)] == [
        *(1, 1, 2, 8, 8),
        0,  # sixteen do not fit
    ]
    assert episodes_of_a_block(Perceptron((2, 2)), 132 * 32, 132, memory) == 32
    assert episodes_of_a_block(Perceptron((2, 2)), 132 * 32 + 1, 132, memory) == 0
    assert robot_task.RobotTask.step is SteppingStones.step
