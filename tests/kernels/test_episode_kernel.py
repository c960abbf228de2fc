"""A whole episode as one kernel of a GPU is what its steps are one by one."""

from __future__ import annotations

import re
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
from evoclaims.envs.ecorobot.stones import SteppingStones
from evoclaims.kernels import episode_in_one_kernel
from evoclaims.kernels.call import episode
from evoclaims.kernels.emit import gpu_kernel
from evoclaims.kernels.emit.episode_kernel import Perceptron, episodes_of_a_block
from evoclaims.methods.flat_champion import policy_of
from evoclaims.networks.base import Bound
from evoclaims.networks.mlp import Mlp
from reproductions.nisioti2025 import REPRODUCTION

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
    """Return episodes of two trials' populations, step by step and as `episode_in_one_kernel` returns them."""

    def play(state: Any, parameters: Any, constants: Any) -> Any:
        for _ in range(STEPS):
            state = _step(state, network.apply(parameters, state[0], outputs), constants)
        return state

    kernel = episode_in_one_kernel(play, _step, STEPS, (inputs, *network.layers, outputs), "This episode")
    of_trials = {"bound": 0, "gain": None}
    one, other = (jax.vmap(jax.vmap(f, (0, 0, None)), (0, 0, of_trials)) for f in (play, kernel))
    return one, other


def _arguments(network: Mlp, inputs: int, outputs: int, second_bound: float = 0.5) -> Any:
    """Draw arguments; the second trial's episodes end beyond a bound, and the first one's do not."""
    rng = np.random.default_rng(0)

    def numbers(*shape: int) -> Any:
        return jnp.asarray(rng.normal(size=(TRIALS, POPULATION, *shape)), jnp.float32)

    state = numbers(inputs), jnp.ones((TRIALS, POPULATION), jnp.int32), numbers() < 2, numbers(0)
    constants = {"bound": jnp.array([[0.0, 100.0], [0.0, second_bound]]), "gain": jnp.float32(0.3)}
    return state, numbers(network.size(inputs, outputs)), constants


@pytest.fixture
def on_threads(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Have a GPU's kernels run by threads of this processor; the programs that ran are in the list."""
    texts: dict[str, str] = {}
    programs: list[Any] = []
    compiled = gpu_kernel.program

    def program(text: str, *given: Any, **named: Any) -> Any:
        made = compiled(text, *given, **named)
        texts[made.ptx] = text
        return made

    def on_gpu(program: Any, operands: Any, shapes: Any, elements: int) -> list[Any]:
        programs.append(program)
        made = run_episodes(texts[program.ptx], program, elements, list(map(np.asarray, operands)), shapes)
        return list(map(jnp.asarray, made))

    monkeypatch.setattr(gpu_kernel, "program", program)
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
def test_each_acting_warp_serves_several_episodes(on_threads: list[Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(episode, "processors_and_memory", lambda: (1, 227 * 1024))
    inputs, layers, outputs = SIZES["two of them"]
    one_by_one, in_kernel = _played(Mlp(layers), inputs, outputs)
    arguments = _arguments(Mlp(layers), inputs, outputs, second_bound=100.0)
    wanted, made = one_by_one(*arguments), in_kernel(*arguments)
    assert [program.elements for program in on_threads] == [8]
    assert np.asarray(made[2])[1].any()  # its episodes, the fifth and the sixth among them, go on
    for a, b in zip(jax.tree.leaves(wanted), jax.tree.leaves(made), strict=True):
        np.testing.assert_allclose(a, b, atol=2e-5)


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


def test_trials_on_a_gpu_play_episode_in_one_kernel(tmp_path: Path) -> None:
    inputs, layers, outputs = SIZES["two of them"]
    network = Mlp(layers)
    (ptx,) = kernels_for_gpus(_played(network, inputs, outputs)[1], *_arguments(network, inputs, outputs))
    assert ".entry this_episode(" in ptx
    assemble(ptx, tmp_path)


def test_the_papers_map_elites_plays_in_one_kernel_on_an_h200(monkeypatch: pytest.MonkeyPatch) -> None:
    condition = REPRODUCTION.tiers["full"].conditions["map_elites", "stones"]
    method, task = condition.method, condition.task
    monkeypatch.setattr(episode, "processors_and_memory", lambda: (132, 227 * 1024))

    def fitness(vector: Any, key: Any) -> Any:
        return task.episode(policy_of(method.network, task, vector), key, jnp.int32(0)).fitness

    vectors = jnp.zeros((10, method.batch, method.network.size(task.observation_size, task.action_size)))
    keys = jax.random.split(jax.random.key(0), (10, method.batch))
    texts = kernels_for_gpus(jax.vmap(jax.vmap(fitness)), vectors, keys)
    assert [name for text in texts for name in re.findall(r"\.entry (\w+)\(", text)] == [
        "a_start_of_stepping_stones",
        "an_episode_of_stepping_stones",
    ]


def test_a_step_that_several_warps_would_share_is_a_kernel_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    inputs, layers, outputs = SIZES["two of them"]
    network = Mlp(layers)
    monkeypatch.setattr(gpu_kernel, "SMALL", 10)
    assert kernels_for_gpus(_played(network, inputs, outputs)[1], *_arguments(network, inputs, outputs)) == []


def test_a_step_that_does_more_than_to_return_a_state_is_played_as_it_is(capfd: pytest.CaptureFixture[str]) -> None:
    def step(state: Any, action: Any, _: Any) -> Any:
        jax.debug.print("acts {}", action, ordered=True)
        return (state[0] + action,)

    def play(state: Any, parameters: Any, constants: Any) -> Any:
        return step(state, Mlp(()).apply(parameters, state[0], 1), constants)

    kernel = episode_in_one_kernel(play, step, 1, (1, 1), "This episode")
    made = jax.jit(kernel)((jnp.ones(1),), jnp.zeros(2), ())
    jax.effects_barrier()
    assert float(made[0][0]) == 1.0
    assert "acts [0.]" in capfd.readouterr().out


@pytest.mark.parametrize(("observed", "parameters"), [(jnp.float32, jnp.int32), (jnp.int32, jnp.float32)])
def test_episodes_of_other_numbers_are_played_step_by_step(observed: Any, parameters: Any) -> None:
    def step(state: Any, action: Any, _: Any) -> Any:
        return ((state[0] + action).astype(observed),)

    def play(state: Any, parameters: Any, constants: Any) -> Any:
        return step(state, parameters[:1] * state[0], constants)

    kernel = episode_in_one_kernel(play, step, 1, (1, 1), "This episode")
    given = (jnp.ones(1, observed),), jnp.ones(2, parameters), ()
    assert kernels_for_gpus(kernel, *given) == []
    assert jax.tree.leaves(jax.jit(kernel)(*given))[0] == 2


class Slow(SteppingStones):
    """Takes half of what the policy says."""

    def step(self, state: Any, action: Any) -> Any:
        """Act."""
        return super().step(state, action / 2)


class Loud(Bound):
    """Says twice what the network does."""

    def __call__(self, observation: Any) -> Any:
        """Act."""
        return 2 * super().__call__(observation)


class Doubled(Mlp):
    """Says twice what a perceptron does."""

    def apply(self, parameters: Any, observation: Any, outputs: int) -> Any:
        """Act."""
        return 2 * super().apply(parameters, observation, outputs)


def test_tasks_with_steps_of_their_own_and_other_networks_are_played_step_by_step() -> None:
    eight = Mlp((8,))
    cases: list[tuple[Any, Any, Any, int]] = [
        (SteppingStones, Bound, eight, 1),
        (Slow, Bound, eight, 0),
        (SteppingStones, Loud, eight, 0),
        (SteppingStones, Bound, Mlp((8,), skip=True), 0),
        (SteppingStones, Bound, Doubled((8,)), 0),
    ]
    for kind, bound, network, kernels in cases:
        task = kind(episode_steps=2)
        policy = bound(network, jnp.zeros(network.size(task.observation_size, task.action_size)), task.action_size)
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
