"""NEAT in the engine: trials are the same alone, in batches, and after a stop."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest
from probes import Probe

from evoclaims.methods.neat.evolution import Neat
from evoclaims.methods.neat.settings import Mutation, Settings, Species
from evoclaims.trials.lanes import Lanes
from evoclaims.trials.layout import Layout
from evoclaims.trials.progress import RunProgress
from evoclaims.trials.result import TrialResult
from evoclaims.trials.runner import run
from evoclaims.trials.spec import Budget, Condition
from evoclaims.trials.store import Store

pytestmark = pytest.mark.newest

SETTINGS = Settings(
    population=20,
    nodes=10,
    connections=24,
    mutation=Mutation(node_add=0.4, connection_add=0.4),
    species=Species(most=4, survival=0.4),
)
TASK = Probe(
    "between",
    cases=((((1.0, 1.0), 1),), (((0.0, 0.0), 0),), (((0.0, 1.0), 0),), (((1.0, 0.0), 0),), (((2.0, 2.0), 0),)),
    cases_at_level=(1, 2, 4, 5),
)
"""Three levels that one neuron solves, and one that none does."""
CONDITION = Condition(Neat(SETTINGS), TASK, "curriculum", Budget(generations=30, reports=6))
SEEDS = (3, 0)


@pytest.fixture(autouse=True)
def _as_in_a_run() -> Iterator[None]:
    """Keys are checked where NEAT's parts are tested; jax takes the keys of any scan under vmap for used."""
    with jax.debug_key_reuse(False):
        yield


@pytest.fixture(scope="module")
def device() -> list[Any]:
    return list(jax.devices("cpu")[:1])


@pytest.fixture(scope="module")
def programs(device: list[Any]) -> Iterator[None]:
    """Let all runs of this file share what has been compiled, whatever the store."""
    kept: dict[tuple[str, int], Any] = {}
    compile_size = Lanes._compile

    def compiled_once(self: Lanes, size: int, homes: Any) -> Any:
        if (self.layout, size) not in kept:
            kept[self.layout, size] = compile_size(self, size, homes)
        return kept[self.layout, size]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Lanes, "_compile", compiled_once)
        yield


@pytest.fixture(scope="module")
def batch(tmp_path_factory: pytest.TempPathFactory, device: list[Any], programs: None) -> list[TrialResult]:
    return run(CONDITION, SEEDS, Store(tmp_path_factory.mktemp("batch")), device)


def test_the_trials_differ_and_climb(batch: list[TrialResult]) -> None:
    assert [result.status for result in batch] == ["done"] * 2
    assert batch[0].digest != batch[1].digest
    assert max(max(result.curves["level"]) for result in batch) > 1


def test_a_trial_alone_is_the_same_trial_to_the_bit(
    batch: list[TrialResult], tmp_path: Path, device: list[Any], programs: None
) -> None:
    (alone,) = run(CONDITION, SEEDS[1:], Store(tmp_path), device)
    assert alone.digest == batch[1].digest


def test_trials_side_by_side_have_the_same_structure_and_nearly_the_same_numbers_in_arrays_of_three_sizes(
    batch: list[TrialResult], tmp_path: Path, device: list[Any], programs: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("evoclaims.trials.lanes.layout_on", lambda platform: Layout.VECTOR)
    monkeypatch.setattr("evoclaims.methods.neat.capacity.SMALLER", ((4, 5), (5, 7)))
    grown = [max(result.curves["champion_connections"]) for result in batch]
    assert max(grown) + 2 > 7  # so that the largest are needed; the first networks fit the smallest
    store, sizes, in_size = Store(tmp_path), set(), Neat.in_size
    monkeypatch.setattr(Neat, "in_size", lambda self, size, state: sizes.add(size) or in_size(self, size, state))
    for one, other in zip(batch, run(CONDITION, SEEDS, store, device), strict=True):
        assert (one.seed, one.status, one.levels["solved_at"]) == (other.seed, other.status, other.levels["solved_at"])
        assert one.curves.keys() == other.curves.keys()
        for name, curve in one.curves.items():
            np.testing.assert_allclose(curve, other.curves[name], rtol=1e-5, err_msg=name)
    assert sizes == {(4, 5), (5, 7), (10, 24), None}


class StoppedError(Exception):
    """Stands for whatever ends a process between two reports."""


def test_a_stopped_run_goes_on_to_the_same_bits(
    batch: list[TrialResult], tmp_path: Path, device: list[Any], programs: None
) -> None:
    store, told = Store(tmp_path), []

    def stop(progress: RunProgress) -> None:
        told.append(progress.phase)
        if told.count("training") == 3:
            raise StoppedError

    with pytest.raises(StoppedError):
        run(CONDITION, SEEDS, store, device, stop, checkpoint_seconds=0.0)
    phases: list[str] = []
    resumed = run(CONDITION, SEEDS, store, device, lambda progress: phases.append(progress.phase))
    assert phases[0] == "resuming"
    assert [result.digest for result in resumed] == [result.digest for result in batch]
