"""Ctrl-C; and SIGTERM, as schedulers send it before they kill: a running batch writes a checkpoint, then ends."""

from __future__ import annotations

import importlib
import os
import queue
import signal
import sys
import threading
import time
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from climbers import CLIMBING, SEEDS, Log, digests

from evoclaims.trials import checkpoint, stopping
from evoclaims.trials.progress import RunProgress
from evoclaims.trials.result import TrialResult
from evoclaims.trials.runner import run
from evoclaims.trials.stopping import interrupted_by, next_of
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


def test_an_interrupt_that_another_thread_receives_ends_the_wait_for_an_item() -> None:
    """So does one that comes just before the wait: neither wakes a lock."""
    items: queue.SimpleQueue[None] = queue.SimpleQueue()
    late = threading.Event()

    def receive() -> None:
        time.sleep(0.1)
        signal.pthread_kill(threading.get_ident(), signal.SIGINT)
        time.sleep(20.0)
        late.set()
        items.put(None)

    threading.Thread(target=receive, daemon=True).start()
    with pytest.raises(KeyboardInterrupt), interrupted_by(signal.SIGINT):
        next_of(items)
    assert not late.is_set()


def test_an_interrupt_comes_after_what_would_lose_it() -> None:
    """What is raised while jax collects garbage is ignored, and what is raised in an import may crash the process."""
    reached = []

    def _xla_gc_callback() -> None:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.005)
        reached.append("the end of the callback")

    def work() -> None:
        _xla_gc_callback()
        reached.append("the code after it")
        time.sleep(10.0)
        reached.append("the end")

    with pytest.raises(KeyboardInterrupt), interrupted_by(signal.SIGINT):
        work()
    assert reached == ["the end of the callback", "the code after it"]


def test_an_interrupt_comes_after_an_import_but_not_after_one_that_lasts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    send = "import os, signal, time\nos.kill(os.getpid(), signal.SIGINT)\n"
    (tmp_path / "soon_imported.py").write_text(send + "time.sleep(0.005)\n")
    (tmp_path / "long_imported.py").write_text(send + "time.sleep(60)\n")

    def work(module: str) -> None:
        importlib.import_module(module)
        time.sleep(10.0)

    with pytest.raises(KeyboardInterrupt), interrupted_by(signal.SIGINT):
        work("soon_imported")
    assert "soon_imported" in sys.modules
    monkeypatch.setattr(stopping, "DEAF_SECONDS", 0.1)
    with pytest.raises(KeyboardInterrupt), interrupted_by(signal.SIGINT):
        work("long_imported")
    assert "long_imported" not in sys.modules
