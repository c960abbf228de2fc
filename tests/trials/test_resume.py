"""A run stopped between two reports goes on from its checkpoint to the bits of a run that was never stopped."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from climbers import CLIMBING, SEEDS, Log, digests, run_climbers
from trial_toys import StoppedError, stopping, walk

from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.cma_es import CmaEs
from evoclaims.networks.all_skips import AllSkips
from evoclaims.trials import checkpoint
from evoclaims.trials.lanes import Lanes
from evoclaims.trials.layout import Layout
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Budget, Condition
from evoclaims.trials.store import Store

pytestmark = pytest.mark.newest


def test_the_toy_ends_in_every_way(uninterrupted: list[TrialResult]) -> None:
    steps = {result.metrics["steps"] for result in uninterrupted if result.status == "done"}
    assert {result.status for result in uninterrupted} == {"done", "diverged"}
    assert max(steps) == 12
    assert min(steps) < 12


@pytest.mark.parametrize("report", [1, 5])
def test_a_stopped_run_goes_on_to_the_same_bits(
    report: int, store: Store, cpus: list[Any], uninterrupted: list[TrialResult], puts: Counter[int]
) -> None:
    with pytest.raises(StoppedError):
        run_climbers(store, cpus, stopping(report))
    assert len(store.ids()) == sum(result.metrics["steps"] <= 2 * report for result in uninterrupted)
    log = Log()
    assert digests(run_climbers(store, cpus, log)) == digests(uninterrupted)
    assert puts == Counter(SEEDS)
    assert log.phases() == ["resuming", "training"]
    assert log.steps()[0] == 2 * (report + 1)
    assert not list(store.checkpoints.iterdir())


def test_a_run_whose_method_was_edited_since_it_was_stopped_begins_anew(
    store: Store, cpus: list[Any], uninterrupted: list[TrialResult], monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(StoppedError):
        run_climbers(store, cpus, stopping(2))
    monkeypatch.setitem(vars(CLIMBING), "code", {**CLIMBING.code, "trial_toys.Walker": "0" * 16})
    log = Log()
    assert digests(run_climbers(store, cpus, log)) == digests(uninterrupted)
    assert "resuming" not in log.phases()


def test_a_run_that_is_killed_before_a_chunk_is_done_gets_further_each_time(
    store: Store, tmp_path: Path, cpus: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each life has the time of three steps, and the whole budget is one chunk."""
    condition = walk(chance=0.1, hazard=0.02, reports=1)
    wanted = run_climbers(Store(tmp_path / "whole"), cpus, condition=condition)
    advance, lived, lives = Lanes.advance, [0, 0], 0

    def mortal(self: Lanes, state: Any, until: int, width: int) -> Any:
        state, report = advance(self, state, until, width)
        steps = int(report.steps.max())
        if steps > lived[1] + 3:
            raise StoppedError
        lived[0] = steps
        return state, report

    monkeypatch.setattr(Lanes, "advance", mortal)
    monkeypatch.setattr("evoclaims.trials.runner.CALL_SECONDS", 0.0)  # a step a call
    while lives < 6:
        lives += 1
        try:
            results = run_climbers(store, cpus, condition=condition)
            break
        except StoppedError:
            lived[1] = lived[0]
    assert lives == 4  # 12 steps
    assert digests(results) == digests(wanted)
    assert [result.curves for result in results] == [result.curves for result in wanted]


def test_a_trial_stored_elsewhere_after_the_checkpoint_is_not_run_again(
    store: Store, cpus: list[Any], uninterrupted: list[TrialResult], puts: Counter[int]
) -> None:
    with pytest.raises(StoppedError):
        run_climbers(store, cpus, stopping(1))
    late = next(result for result in uninterrupted if result.metrics["steps"] == 12)
    store.put(late, {})
    puts.clear()
    log = Log()
    assert digests(run_climbers(store, cpus, log)) == digests(uninterrupted)
    assert puts[late.seed] == 0
    assert max(log.steps()) == max(r.metrics["steps"] for r in uninterrupted if r is not late) < 10  # its lane is idle


def test_a_batch_that_has_narrowed_goes_on_to_the_same_bits(
    store: Store, tmp_path: Path, cpus: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("evoclaims.trials.lanes.layout_on", lambda platform: Layout.VECTOR)
    wanted = run_climbers(Store(tmp_path / "whole"), cpus)
    with pytest.raises(StoppedError):
        run_climbers(store, cpus, stopping(5))
    (header,) = checkpoint.sound_ones(store.checkpoints, CLIMBING.id)
    assert len(header.lanes) == 2 < len(SEEDS)
    assert digests(run_climbers(store, cpus)) == digests(wanted)


def test_cma_es_goes_on_to_the_same_bits(store: Store, tmp_path: Path, cpus: list[Any]) -> None:
    """The same condition as in test_trial_bits, so that it is compiled once."""
    condition = Condition(
        CmaEs(6, network=AllSkips(hidden=2)), NParity(3), "curriculum", Budget(generations=12, reports=4)
    )
    (wanted,) = run_climbers(Store(tmp_path / "whole"), cpus[:1], condition=condition, seeds=[0])
    with pytest.raises(StoppedError):
        run_climbers(store, cpus[:1], stopping(2), condition=condition, seeds=[0])
    (resumed,) = run_climbers(store, cpus[:1], condition=condition, seeds=[0])
    assert resumed.digest == wanted.digest
