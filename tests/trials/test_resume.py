"""A run stopped between two reports goes on from its checkpoint to the bits of a run that was never stopped."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from trial_toys import StoppedError, stopping, walk

from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.cma_es import CmaEs
from evoclaims.networks.all_skips import AllSkips
from evoclaims.trials import checkpoint
from evoclaims.trials.budget import Budget
from evoclaims.trials.progress import RunProgress, ignore
from evoclaims.trials.result import TrialResult
from evoclaims.trials.runner import run
from evoclaims.trials.spec import Condition, TrialSpec
from evoclaims.trials.store import Store

CLIMBING = walk(chance=0.35, hazard=0.04)
"""Of the seeds 1 to 5 some end early, one diverges and one spends the whole budget."""
SEEDS = range(1, 6)


class Log(list[RunProgress]):
    """A watcher that keeps what it was told."""

    __call__ = list.append

    def steps(self) -> list[int]:
        return [progress.steps for progress in self if progress.phase == "training"]

    def phases(self) -> list[str]:
        return list(dict.fromkeys(progress.phase for progress in self))


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory: pytest.TempPathFactory, cpus: list[Any]) -> list[TrialResult]:
    return run(CLIMBING, SEEDS, Store(tmp_path_factory.mktemp("uninterrupted")), cpus)


@pytest.fixture
def puts(monkeypatch: pytest.MonkeyPatch) -> Counter[int]:
    """How often each seed was put into any store."""
    counts: Counter[int] = Counter()
    put = Store.put

    def counting(self: Store, result: TrialResult, champion: Any) -> Any:
        counts[result.seed] += 1
        return put(self, result, champion)

    monkeypatch.setattr(Store, "put", counting)
    return counts


def _run(
    store: Store,
    cpus: Sequence[Any],
    watch: Callable[[RunProgress], None] = ignore,
    condition: Condition = CLIMBING,
    seeds: Sequence[int] = SEEDS,
) -> list[TrialResult]:
    return run(condition, seeds, store, cpus, watch, checkpoint_seconds=0.0)


def _digests(results: Sequence[TrialResult]) -> list[str]:
    return [result.digest for result in results]


def test_the_toy_ends_in_every_way(uninterrupted: list[TrialResult]) -> None:
    steps = {result.metrics["steps"] for result in uninterrupted if result.status == "done"}
    assert {result.status for result in uninterrupted} == {"done", "diverged"}
    assert max(steps) == 12
    assert min(steps) < 12


@pytest.mark.parametrize("report", [1, 3, 5])
def test_a_stopped_run_goes_on_to_the_same_bits(
    report: int, store: Store, cpus: list[Any], uninterrupted: list[TrialResult], puts: Counter[int]
) -> None:
    with pytest.raises(StoppedError):
        _run(store, cpus, stopping(report))
    assert len(store.ids()) == sum(result.metrics["steps"] <= 2 * report for result in uninterrupted)
    log = Log()
    assert _digests(_run(store, cpus, log)) == _digests(uninterrupted)
    assert puts == Counter(SEEDS)
    assert log.phases() == ["resuming", "training"]
    assert log.steps()[0] == 2 * (report + 1)
    assert not list(store.checkpoints.iterdir())


def test_a_run_stopped_again_and_again_goes_on_to_the_same_bits(
    store: Store, cpus: list[Any], uninterrupted: list[TrialResult], puts: Counter[int]
) -> None:
    for _ in range(5):
        with pytest.raises(StoppedError):
            _run(store, cpus, stopping(1))
    assert _digests(_run(store, cpus)) == _digests(uninterrupted)
    assert puts == Counter(SEEDS)


def test_a_stopped_run_goes_on_beside_trials_that_had_been_stored_before(
    store: Store, cpus: list[Any], uninterrupted: list[TrialResult], puts: Counter[int]
) -> None:
    _run(store, cpus, seeds=[2, 4])
    with pytest.raises(StoppedError):
        _run(store, cpus, stopping(2))
    assert _digests(_run(store, cpus)) == _digests(uninterrupted)
    assert puts == Counter(SEEDS)


def test_a_trial_stored_elsewhere_after_the_checkpoint_is_not_run_again(
    store: Store, cpus: list[Any], uninterrupted: list[TrialResult], puts: Counter[int]
) -> None:
    with pytest.raises(StoppedError):
        _run(store, cpus, stopping(1))
    late = next(result for result in uninterrupted if result.metrics["steps"] == 12)
    store.put(late, {})
    puts.clear()
    log = Log()
    assert _digests(_run(store, cpus, log)) == _digests(uninterrupted)
    assert puts[late.seed] == 0
    assert max(log.steps()) == max(r.metrics["steps"] for r in uninterrupted if r is not late) < 10  # its lane is idle


def test_a_checkpoint_whose_trials_are_all_stored_is_removed(
    store: Store, cpus: list[Any], uninterrupted: list[TrialResult]
) -> None:
    with pytest.raises(StoppedError):
        _run(store, cpus, stopping(1))
    for result in uninterrupted:
        store.put(result, {})
    log = Log()
    assert _digests(_run(store, cpus, log, seeds=[*SEEDS, 0]))[:-1] == _digests(uninterrupted)
    assert log.phases() == ["compiling", "training"]
    assert not list(store.checkpoints.iterdir())


def test_more_trials_may_be_asked_for_than_the_stopped_run_had(
    store: Store, cpus: list[Any], uninterrupted: list[TrialResult], puts: Counter[int]
) -> None:
    with pytest.raises(StoppedError):
        _run(store, cpus, stopping(2), seeds=[1, 5])
    log = Log()
    assert _digests(_run(store, cpus, log)) == _digests(uninterrupted)
    assert log.phases() == ["resuming", "training", "compiling"]
    assert puts == Counter(SEEDS)


def test_a_checkpoint_of_another_platform_is_passed_over(
    store: Store,
    cpus: list[Any],
    uninterrupted: list[TrialResult],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr("evoclaims.trials.runner.collect", lambda: {"machine": "a", "versions": "b", "xla_flags": "c"})
        with pytest.raises(StoppedError):
            _run(store, cpus, stopping(2))
    log = Log()
    assert _digests(_run(store, cpus, log)) == _digests(uninterrupted)
    assert "resuming" not in log.phases()


def test_a_batch_that_has_narrowed_goes_on_to_the_same_bits(
    store: Store, tmp_path: Path, cpus: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("evoclaims.trials.lanes.layout_for", lambda devices: "vector")
    wanted = _run(Store(tmp_path / "whole"), cpus)
    with pytest.raises(StoppedError):
        _run(store, cpus, stopping(5))
    (header,) = (checkpoint.read(path)[0] for path in store.checkpoints.iterdir())
    assert len(header.lanes) == 2 < len(SEEDS)
    assert _digests(_run(store, cpus)) == _digests(wanted)


def test_cma_es_goes_on_to_the_same_bits(store: Store, tmp_path: Path, cpus: list[Any]) -> None:
    """The same condition as in test_trial_bits, so that it is compiled once."""
    condition = Condition(
        CmaEs(6, network=AllSkips(hidden=2)), NParity(3), "curriculum", Budget(generations=12, reports=4)
    )
    (wanted,) = _run(Store(tmp_path / "whole"), cpus[:1], condition=condition, seeds=[0])
    with pytest.raises(StoppedError):
        _run(store, cpus[:1], stopping(2), condition=condition, seeds=[0])
    (resumed,) = _run(store, cpus[:1], condition=condition, seeds=[0])
    assert resumed.digest == wanted.digest


def test_stored_trials_are_never_run_again(
    store: Store, cpus: list[Any], monkeypatch: pytest.MonkeyPatch, puts: Counter[int]
) -> None:
    first = _run(store, cpus)
    monkeypatch.setattr("evoclaims.trials.runner.Lanes", None)
    log = Log()
    assert [result.to_json() for result in _run(store, cpus, log)] == [result.to_json() for result in first]
    assert (log, puts) == ([], Counter(SEEDS))


def test_only_the_missing_trials_are_run(store: Store, cpus: list[Any], puts: Counter[int]) -> None:
    _run(store, cpus, seeds=[2])
    results = _run(store, cpus, seeds=[4, 2, 5])
    assert [result.seed for result in results] == [4, 2, 5]
    assert puts == Counter([2, 5, 4])
    assert results[0].timing["batch"] == 2


def test_the_last_report_says_that_every_trial_has_ended(store: Store, cpus: list[Any]) -> None:
    log = Log()
    _run(store, cpus, log)
    assert [p.ended for p in log] == sorted(p.ended for p in log)
    last = log[-1]
    assert (last.trials, last.ended, last.seconds_left, last.total_steps, last.levels) == (5, 5, 0.0, 12, 3)
    assert store.get(TrialSpec(CLIMBING, 5).id) is not None
