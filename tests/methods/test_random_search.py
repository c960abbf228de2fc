"""Random search is the best of all that it has drawn; the random policy is a draw."""

from __future__ import annotations

import math
from typing import Any

import jax
import numpy as np
import pytest
from probes import Probe
from workbench import Workbench

from evoclaims.core.errors import UserError
from evoclaims.core.keys import stream
from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.random_policy import RandomPolicy
from evoclaims.methods.random_search import RandomSearch
from evoclaims.networks.all_skips import AllSkips
from evoclaims.networks.mlp import Mlp

STEPS, SEED = 6, 2


def test_its_champion_is_the_best_of_everyone_drawn(benches: dict[str, Any]) -> None:
    bench = benches["random_search"]
    state, reports = bench.run(STEPS, seed=SEED, level=1)
    rows = bench.task.table.inputs
    wanted = [sum(map(int, row)) % 2 == 1 for row in rows]
    best, individuals, when = -np.inf, [], []
    for step in range(STEPS):
        key = stream(jax.random.fold_in(jax.random.key(SEED + 1), step), "draw")
        population = np.asarray(jax.random.normal(key, (bench.method.population, len(state.parameters))))
        for individual in population:
            answers = [_fire(individual.astype(np.float64), row, bench.method.network.hidden) > 0 for row in rows]
            fitness = -np.mean([answer != bit for answer, bit in zip(answers, wanted, strict=True)])
            if fitness > best:
                individuals = []
            if fitness >= best:
                individuals.append(individual)
            best = max(best, fitness)
        when.append(best)
    assert [float(progress.fitness) for progress in reports] == when
    assert any(np.array_equal(individual, state.parameters) for individual in individuals)


def _fire(parameters: Any, bits: Any, hidden: int) -> float:
    """Return the one output of an all-skips network, neuron by neuron."""
    inputs, neurons = len(bits), hidden + 1
    feed = parameters[: neurons * (inputs + 1)].reshape(neurons, inputs + 1)
    readout = parameters[neurons * (inputs + 1) :][:hidden]
    between = list(parameters[neurons * (inputs + 1) + hidden :])
    fired: list[float] = []
    for neuron in range(hidden):
        weights = [between.pop(0) for _ in range(neuron)]
        fired.append(np.tanh(feed[neuron] @ [*bits, 1.0] + np.dot(weights, fired)))
    return float(feed[hidden] @ [*bits, 1.0] + np.dot(readout, fired))


def test_the_standard_deviation_scales_what_is_drawn() -> None:
    """Every draw is right where every answer is, so that the newcomer is champion."""
    task = Probe("always_right", cases=((((0.0,), None),),), cases_at_level=(1,))
    drawn = {}
    for std in (1.0, 3.0):
        method = RandomSearch(1, std, AllSkips(2))
        drawn[std] = Workbench(method, task).run(1)[0]
    np.testing.assert_allclose(drawn[3.0].parameters, 3.0 * drawn[1.0].parameters, rtol=1e-6)
    assert float(np.abs(drawn[1.0].parameters).max()) > 0


def test_a_random_policy_s_parameters_are_standard_normal_and_differ_between_seeds() -> None:
    method = RandomPolicy(Mlp((64,) * 2))
    draws = np.stack([method.init(jax.random.key(seed), NParity(3)).parameters for seed in range(4)])
    assert len(np.unique(draws[:, 0])) == 4
    assert abs(draws.mean()) < 0.05
    assert abs(draws.std() - 1) < 0.05


@pytest.mark.parametrize("wrong", [{"population": 0}, *({"std": wrong} for wrong in (0.0, -1.0, math.inf, math.nan))])
def test_impossible_sizes_are_one_sentence(wrong: dict[str, Any]) -> None:
    with pytest.raises(UserError, match="population of at least 1 and a finite std above 0"):
        RandomSearch(**wrong)
