"""Which trials go on from a checkpoint, in which lanes, and when a checkpoint goes."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from climbers import CLIMBING, SEEDS, Log, digests, run_climbers
from trial_toys import StoppedError, stopping

from evoclaims.core.provenance import collect
from evoclaims.trials import checkpoint
from evoclaims.trials.lanes import Lanes
from evoclaims.trials.layout import Layout
from evoclaims.trials.result import TrialResult
from evoclaims.trials.store import Store

pytestmark = pytest.mark.oldest


@pytest.mark.parametrize("part", ["machine", "prng"])
def test_a_checkpoint_of_another_platform_is_passed_over_and_stays_while_it_owes_a_trial(
    part: str, store: Store, cpus: list[Any], uninterrupted: list[TrialResult], monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr("evoclaims.trials.result_making.collect", lambda: {**collect(), part: "another"})
        with pytest.raises(StoppedError):
            run_climbers(store, cpus, stopping(1))
    (path,) = store.checkpoints.iterdir()
    owed = checkpoint.sound_ones(store.checkpoints, CLIMBING.id)[0].seeds
    log = Log()
    run_climbers(store, cpus, log, seeds=owed[1:])
    assert list(store.checkpoints.iterdir()) == [path]
    assert digests(run_climbers(store, cpus, log)) == digests(uninterrupted)
    assert list(store.checkpoints.iterdir()) == []
    assert "resuming" not in log.phases()


def test_an_interrupted_batch_waits_until_one_of_its_trials_is_asked_for(
    store: Store, cpus: list[Any], uninterrupted: list[TrialResult], puts: Counter[int]
) -> None:
    with pytest.raises(StoppedError):
        run_climbers(store, cpus, stopping(1), seeds=[1, 5])
    (path,) = store.checkpoints.iterdir()
    log = Log()
    assert digests(run_climbers(store, cpus, log, seeds=[3])) == [uninterrupted[2].digest]
    assert "resuming" not in log.phases()
    assert list(store.checkpoints.iterdir()) == [path]
    assert puts.keys() == {3}
    assert digests(run_climbers(store, cpus, log, seeds=[5])) == [uninterrupted[4].digest]
    assert "resuming" in log.phases()
    assert puts == Counter([3, 1, 5])


def test_a_checkpoint_that_a_kill_left_behind_goes_though_nothing_is_missing(
    store: Store, cpus: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(checkpoint, "remove", lambda folder, header: None)
        run_climbers(store, cpus)
    (path,) = store.checkpoints.iterdir()
    torn = path.with_name(f"{CLIMBING.id}-torn.npz")
    torn.write_bytes(b"PK")
    monkeypatch.setattr("evoclaims.trials.runner.Lanes", None)
    run_climbers(store, cpus)
    assert list(store.checkpoints.iterdir()) == [torn]  # left for `evoclaims verify`


@pytest.fixture
def side_by_side(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, int]]:
    """Lay trials out as on a GPU; gives the steps and the number of lanes of every chunk that is run."""
    monkeypatch.setattr("evoclaims.trials.lanes.layout_on", lambda platform: Layout.VECTOR)
    chunks: list[tuple[int, int]] = []
    advance = Lanes.advance

    def telling(self: Lanes, state: Any, until: int, width: int) -> Any:
        chunks.append((until, width))
        return advance(self, state, until, width)

    monkeypatch.setattr(Lanes, "advance", telling)
    return chunks


def _stop_with_an_old_checkpoint(store: Store, cpus: list[Any], report: int) -> None:
    """Stop at a report, with no checkpoint but that of the first chunk."""
    save = checkpoint.save
    saved: list[Any] = []

    def once(*arguments: Any) -> None:
        if not saved:
            saved.append(save(*arguments))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(checkpoint, "save", once)
        with pytest.raises(StoppedError):
            run_climbers(store, cpus, stopping(report))


def test_side_by_side_trials_that_ended_after_the_checkpoint_run_along_so_that_the_widths_stay_the_same(
    store: Store, tmp_path: Path, cpus: list[Any], side_by_side: list[tuple[int, int]], puts: Counter[int]
) -> None:
    """The bits of a trial depend on the width there, so that it must not depend on when a kill came."""
    wanted = run_climbers(Store(tmp_path / "whole"), cpus)
    whole = side_by_side.copy()
    assert whole[0][1] > whole[-1][1]
    puts.clear()
    _stop_with_an_old_checkpoint(store, cpus, 5)
    stored = set(puts)
    assert len(stored) >= 3  # enough to narrow the batch
    side_by_side.clear()
    log = Log()
    assert digests(run_climbers(store, cpus, log)) == digests(wanted)
    assert side_by_side == whole[1:]
    assert puts == Counter(SEEDS)
    assert (log[0].phase, log[0].trials) == ("resuming", len(SEEDS) - len(stored))
    assert [progress.ended for progress in log[1:-1]] == [len(stored)] * len(log[1:-1])
    assert not list(store.checkpoints.iterdir())


def test_side_by_side_a_batch_ends_when_nothing_is_owed_though_a_stored_trial_runs_along(
    store: Store, cpus: list[Any], uninterrupted: list[TrialResult], side_by_side: list[tuple[int, int]]
) -> None:
    with pytest.raises(StoppedError):
        run_climbers(store, cpus, stopping(1))
    late = max(uninterrupted, key=lambda result: result.metrics["steps"])
    store.put(late, {})
    side_by_side.clear()
    run_climbers(store, cpus)
    others = [result.metrics["steps"] for result in uninterrupted if result is not late]
    assert max(others) <= max(steps for steps, _ in side_by_side) < late.metrics["steps"]


def test_side_by_side_a_checkpoint_that_marks_no_stored_trial_as_idle_goes_on_too(
    store: Store, tmp_path: Path, cpus: list[Any], side_by_side: list[tuple[int, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As they were written before a trial was made idle when it had been stored."""
    wanted = run_climbers(Store(tmp_path / "whole"), cpus[:1])
    with pytest.raises(StoppedError):
        run_climbers(store, cpus[:1], stopping(3))
    (header,) = checkpoint.sound_ones(store.checkpoints, CLIMBING.id)
    assert None in header.lanes
    restore = checkpoint.restore

    def unmarked(*arguments: Any) -> Any:
        state = restore(*arguments)
        return replace(state, idle=np.zeros_like(state.idle))

    monkeypatch.setattr(checkpoint, "restore", unmarked)
    assert digests(run_climbers(store, cpus[:1])) == digests(wanted)


@pytest.mark.parametrize("layout", Layout)
def test_side_by_side_a_batch_goes_on_with_as_many_devices_as_it_had_and_alone_with_any_number(
    layout: Layout, store: Store, cpus: list[Any], uninterrupted: list[TrialResult], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Lanes share a device side by side: the width on each would be another one."""
    monkeypatch.setattr("evoclaims.trials.lanes.layout_on", lambda platform: layout)
    with pytest.raises(StoppedError):
        run_climbers(store, cpus, stopping(1))
    log = Log()
    results = run_climbers(store, cpus[:1], log)
    assert ("resuming" in log.phases()) is layout.alone
    assert not layout.alone or digests(results) == digests(uninterrupted)
