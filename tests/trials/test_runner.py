"""What a run runs, what it tells whoever watches, and how it fails."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import Any

import jax
import numpy as np
import pytest
from climbers import CLIMBING, SEEDS, Log, run_climbers
from trial_toys import walk

from evoclaims.core.errors import UserError
from evoclaims.trials.lanes import Lanes
from evoclaims.trials.layout import Layout
from evoclaims.trials.progress import RunProgress
from evoclaims.trials.result import TrialResult
from evoclaims.trials.result_codec import dump
from evoclaims.trials.spec import TrialSpec
from evoclaims.trials.store import Store

pytestmark = pytest.mark.oldest


def test_only_missing_trials_are_run_and_stored_ones_never_again(
    store: Store, cpus: list[Any], monkeypatch: pytest.MonkeyPatch, puts: Counter[int]
) -> None:
    run_climbers(store, cpus, seeds=[2])
    results = run_climbers(store, cpus, seeds=[4, 2, 5])
    assert [result.seed for result in results] == [4, 2, 5]
    assert puts == Counter([2, 5, 4])
    assert results[0].timing["batch"] == 2
    first = run_climbers(store, cpus)
    monkeypatch.setattr("evoclaims.trials.runner.Lanes", None)
    log = Log()
    assert [*map(dump, run_climbers(store, cpus, log))] == [*map(dump, first)]
    assert (log, puts) == ([], Counter(SEEDS))


@pytest.mark.parametrize("layout", Layout)
def test_a_report_tells_of_the_trials_that_run_whatever_lanes_they_have_moved_to(
    layout: Layout, store: Store, cpus: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("evoclaims.trials.lanes.layout_on", lambda platform: layout)
    log = Log()
    seeds = range(12)
    results = run_climbers(store, cpus, log, condition=walk(chance=0.4, hazard=0.15, bits=6), seeds=seeds)
    told = [(progress.level, progress.best) for progress in log if progress.phase == "training"]
    expected = []
    for report in range(len(told) - 1):
        going = [r.curves for r in results if len(r.curves["steps"]) > report + 1]
        level = max(curves["level"][report] for curves in going)
        expected.append((level, max(c["success"][report] for c in going if c["level"][report] == level)))
    assert told[:-1] == expected


def test_the_last_report_says_that_every_trial_has_ended(store: Store, cpus: list[Any]) -> None:
    log = Log()
    run_climbers(store, cpus, log)
    assert [p.ended for p in log] == sorted(p.ended for p in log)
    last = log[-1]
    assert (last.trials, last.ended, last.seconds_left, last.total_steps, last.levels) == (5, 5, 0.0, 12, 3)
    assert store.get(TrialSpec(CLIMBING, 5).id) is not None


def test_a_trial_that_another_process_stored_meanwhile_with_other_bits_is_told_of(
    store: Store,
    cpus: list[Any],
    uninterrupted: list[TrialResult],
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    metrics = {**uninterrupted[1].metrics, "mean_success": 0.125}
    other = replace(uninterrupted[1], metrics=metrics, digest="0" * 64)

    def intrude(progress: RunProgress) -> None:
        log(progress)
        if progress.phase == "compiling":
            store.put(other, {"w": np.ones(3)})

    log = Log()
    results = run_climbers(store, cpus, intrude)
    assert [result.digest for result in results] == [
        other.digest if result.seed == other.seed else result.digest for result in uninterrupted
    ]
    assert store.champion_of(store.get(other.id))["w"].tolist() == [1.0, 1.0, 1.0]
    text = f"seed {other.seed} is stored already and came out differently here: the first record stays"
    assert text in log.phases()
    assert [record.getMessage() for record in caplog.records if record.name.startswith("evoclaims")] == [
        f"walker on n_parity: {text}."
    ]


def test_a_device_without_enough_memory_is_a_sentence_that_says_what_to_do(
    store: Store, cpus: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(text: str) -> None:
        def advance(*arguments: Any) -> None:
            raise jax.errors.JaxRuntimeError(text)

        monkeypatch.setattr(Lanes, "advance", advance)

    fail("RESOURCE_EXHAUSTED: Out of memory while trying to allocate 123456 bytes.")
    with pytest.raises(UserError, match="does not hold 1 trial of walker on n_parity at once, and fewer cannot be run"):
        run_climbers(store, cpus)
    fail("INTERNAL: something else")
    with pytest.raises(jax.errors.JaxRuntimeError, match="something else"):
        run_climbers(store, cpus)
