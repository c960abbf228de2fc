"""SIGTERM, as schedulers and containers send it before they kill: a running batch writes a checkpoint, then ends."""

from __future__ import annotations

import os
import signal
from collections import Counter
from typing import Any

import pytest
from climbers import CLIMBING, SEEDS, Log, digests

from evoclaims.trials import checkpoint
from evoclaims.trials.progress import RunProgress
from evoclaims.trials.result import TrialResult
from evoclaims.trials.runner import run
from evoclaims.trials.stopping import interrupted_by
from evoclaims.trials.store import Store

NEVER = 1e9
"""Seconds between two checkpoints of a run that is shorter."""


def _terminated_at(report: int) -> Any:
    """Return a watcher that sends this process the signal at a report of training, counted from 1."""
    reports = Counter[str]()

    def watch(progress: RunProgress) -> None:
        reports[progress.phase] += 1
        if progress.phase == "training" and reports["training"] == report:
            os.kill(os.getpid(), signal.SIGTERM)

    return watch


def test_a_terminated_run_writes_a_checkpoint_and_goes_on_from_it_to_the_same_bits(
    store: Store, cpus: list[Any], uninterrupted: list[TrialResult], puts: Counter[int]
) -> None:
    with interrupted_by(signal.SIGTERM), pytest.raises(KeyboardInterrupt):
        run(CLIMBING, SEEDS, store, cpus, _terminated_at(2), checkpoint_seconds=NEVER)
    (header,) = checkpoint.sound_ones(store.checkpoints, CLIMBING.id)
    assert header.chunks >= 2
    log = Log()
    assert digests(run(CLIMBING, SEEDS, store, cpus, log)) == digests(uninterrupted)
    assert puts == Counter(SEEDS)
    assert not list(checkpoint.sound_ones(store.checkpoints, CLIMBING.id))


def test_the_signal_interrupts_at_once_where_no_batch_runs_and_is_as_before_afterwards() -> None:
    before = signal.getsignal(signal.SIGTERM)
    with pytest.raises(KeyboardInterrupt), interrupted_by(signal.SIGTERM):
        os.kill(os.getpid(), signal.SIGTERM)
    assert signal.getsignal(signal.SIGTERM) == before


def test_an_ignored_signal_stays_ignored() -> None:
    before = signal.signal(signal.SIGTERM, signal.SIG_IGN)
    try:
        with interrupted_by(signal.SIGTERM):
            os.kill(os.getpid(), signal.SIGTERM)
    finally:
        signal.signal(signal.SIGTERM, before)
