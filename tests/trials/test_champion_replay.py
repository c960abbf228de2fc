"""Champions out of the store: they score what their records say, and what is not theirs is told."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from trial_toys import walk

from evoclaims.core.errors import UserError
from evoclaims.envs.base import Episode, PolicyFn
from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.cma_es import CmaEs
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.methods.hyperneat import HyperNeat
from evoclaims.methods.neat.evolution import Neat
from evoclaims.methods.neat.settings import Settings, Species
from evoclaims.methods.ppo import Ppo
from evoclaims.networks.all_skips import AllSkips
from evoclaims.trials import champion_replay
from evoclaims.trials.result import TrialResult
from evoclaims.trials.runner import run
from evoclaims.trials.spec import Budget, Condition
from evoclaims.trials.store import DamagedFileError, Store

pytestmark = pytest.mark.newest

SMALL = Settings(population=16, nodes=12, connections=24, activations=("tanh", "sin"), species=Species(most=4))
METHODS = {
    "neat": Neat(SMALL),
    "hyperneat": HyperNeat(SMALL, hidden=(3,)),
    "cma_es": CmaEs(8, network=AllSkips(hidden=2)),
    "ppo": Ppo((4,), (4,), environments=4, batch_size=4, minibatches=2, updates_per_batch=1),
    "hand_built": HandBuilt(),
}


@dataclass(frozen=True)
class Moody(NParity):
    """N-parity whose examination adds the outputs' mean to the fitness, and a mood that the key decides."""

    name: ClassVar[str] = "moody"

    def examine(self, policy: PolicyFn, key: jax.Array, level: Any) -> Episode:
        episode = super().examine(policy, key, level)
        outputs = jax.vmap(policy)(jnp.asarray(self.table.inputs))
        return replace(episode, fitness=episode.fitness + jnp.mean(outputs) + jax.random.uniform(key))


def _condition(name: str) -> Condition:
    task = Moody(3, "sampled") if name == "ppo" else Moody(3)
    return Condition(METHODS[name], task, "curriculum", Budget(generations=6, reports=2))


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory, cpus: list[Any]) -> Callable[[str], tuple[Store, list[TrialResult]]]:
    """A function that runs a method's trials, once."""
    store = Store(tmp_path_factory.mktemp("champions"))
    return lambda name: (store, run(_condition(name), range(2), store, cpus))


@pytest.mark.parametrize("name", METHODS)
def test_a_champion_loaded_from_the_store_replays_to_the_same_fitness(name: str, ran: Any, cpus: list[Any]) -> None:
    store, (other, result) = ran(name)
    assert other.levels["fitness"] != result.levels["fitness"]
    parameters = champion_replay.load(store, _condition(name), result)
    replay = champion_replay.replay(_condition(name), result, parameters, cpus)
    assert replay.again == {key: result.levels[key] for key in ("success", "fitness")}
    assert (replay.exact, replay.elsewhere) == (True, ())


def test_a_replay_of_other_parameters_or_of_another_seed_is_not_exact(ran: Any, cpus: list[Any]) -> None:
    store, (result, other) = ran("cma_es")
    condition = _condition("cma_es")
    parameters = champion_replay.load(store, condition, result)
    assert not champion_replay.replay(condition, result, parameters * np.float32(0.99), cpus).exact
    assert not champion_replay.replay(condition, replace(result, seed=other.seed), parameters, cpus).exact


def test_nan_is_replayed_as_nan(ran: Any, cpus: list[Any]) -> None:
    store, (result, *_) = ran("cma_es")
    condition = _condition("cma_es")
    broken = np.full_like(champion_replay.load(store, condition, result), np.nan)
    nan = replace(result, levels={**result.levels, "fitness": (np.nan, np.nan)})
    replay = champion_replay.replay(condition, nan, broken, cpus)
    assert np.isnan(replay.again["fitness"]).all()
    assert replace(replay, again={"fitness": replay.again["fitness"]}).exact


def test_what_differs_between_here_and_where_the_trial_was_made_is_named(ran: Any, cpus: list[Any]) -> None:
    store, (result, *_) = ran("cma_es")
    condition = _condition("cma_es")
    parameters = champion_replay.load(store, condition, result)
    versions = {**result.provenance["versions"], "jax": "0.0.1"}
    for provenance, named in (
        ({**result.provenance, "machine": "a mainframe", "versions": versions}, ("machine", "versions")),
        ({**result.provenance, "device": {"platform": "cpu", "kind": "abacus", "count": 1}}, ("kind",)),
        ({**result.provenance, "git": None}, ()),
        ({}, ("kind",)),
    ):
        replay = champion_replay.replay(condition, replace(result, provenance=provenance), parameters, cpus)
        assert replay.elsewhere == named


def test_a_champion_whose_file_was_changed_is_told(ran: Any, tmp_path: Path) -> None:
    store, (result, *_) = ran("neat")
    condition, store = _condition("neat"), Store(shutil.copytree(store.root, tmp_path / "copy"))
    path = store.champion_file(result)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    with pytest.raises(DamagedFileError, match="it is not the champion that the trial's record names"):
        champion_replay.load(store, condition, result)
    path.unlink()
    with pytest.raises(DamagedFileError, match="cannot be read"):
        champion_replay.load(store, condition, result)


def test_arrays_that_are_not_the_methods_or_not_there_are_told(cpus: list[Any], tmp_path: Path) -> None:
    condition = walk()
    (result,) = run(condition, [0], Store(tmp_path), cpus)
    parameters = champion_replay.unpacked({"parameters": np.zeros(4, np.float32)}, condition, result)
    assert parameters.tolist() == [0.0] * 4
    for arrays in (
        {"parameters": np.zeros(3, np.float32)},
        {"parameters": np.zeros(4, np.float64)},
        {"weights": np.zeros(4, np.float32)},
        {"parameters": np.zeros(4, np.float32), "more": np.zeros(1)},
    ):
        with pytest.raises(UserError, match="walker on n_parity, seed 0, does not have the arrays .* another version"):
            champion_replay.unpacked(arrays, condition, result)
    with pytest.raises(UserError, match="Seed 0 of walker on n_parity has no champion: it is crashed"):
        champion_replay.unpacked({}, condition, replace(result, status="crashed"))
