"""What a process runs is told to others, for as long as it runs and no longer."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from climbers import CLIMBING, run_climbers
from msgspec import json

from evoclaims.trials import lease as bulletins
from evoclaims.trials.integrity import verify
from evoclaims.trials.lease import Running, announced, lease_path, progress_path, running, shared, sweep
from evoclaims.trials.progress import RunProgress, ignore
from evoclaims.trials.store import Store

CONDITION, OTHER = "c0" * 32, "0c" * 32
COMPILING = RunProgress("a on b", "compiling", 3)
TRAINING = RunProgress("a on b", "training", 3, 1, 20, 40, 0.5, 1, 5, 7.0)


def test_a_run_tells_others_its_progress_until_it_ends(store: Store, cpus: Sequence[Any]) -> None:
    told: list[RunProgress] = []
    seen: list[RunProgress] = []

    def watch(progress: RunProgress) -> None:
        told.append(progress)
        (one,) = running(store.root)
        assert one.condition == CLIMBING.id
        assert 0 <= time.time() - one.since < 600
        seen.append(one.progress)

    run_climbers(store, cpus, watch)
    assert seen[0] == told[0]
    assert seen[0].phase == "compiling"
    assert {one.phase for one in seen} == {"compiling", "training"}
    assert running(store.root) == []
    assert list((store.root / "running").iterdir()) == []


def test_who_waits_for_another_process_tells_nothing_in_its_place(store: Store, cpus: Sequence[Any]) -> None:
    store.check_writable()
    lease = lease_path(store.root, CLIMBING.id)
    lease.parent.mkdir()
    other = f"filelock/2\npid=1\nhost=elsewhere\nmode=lease\ntoken={'a' * 32}\nduration=60.0\n"
    lease.write_text(other)
    waited = []

    def watch(progress: RunProgress) -> None:
        if progress.phase.startswith("waiting"):
            waited.append(progress_path(store.root, CLIMBING.id).exists())
            lease.unlink(missing_ok=True)

    run_climbers(store, cpus, watch)
    assert waited
    assert not any(waited)


def test_files_are_written_now_and_then_and_when_the_phase_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    later = RunProgress("a on b", "training", 3, 2, 30, 40, 0.5, 1, 5, 7.0)
    with announced(tmp_path, CONDITION), shared(tmp_path, CONDITION, ignore) as tell:
        for progress, shown in ((COMPILING, COMPILING), (TRAINING, TRAINING), (later, TRAINING)):
            tell(progress)
            assert [one.progress for one in running(tmp_path)] == [shown]
        monkeypatch.setattr(bulletins, "WRITE_SECONDS", 0.0)
        tell(later)
        assert [one.progress for one in running(tmp_path)] == [later]
        tell(RunProgress("a on b", "training", 3, best=float("nan"), seconds_left=float("inf")))
        (one,) = running(tmp_path)
        assert (one.progress.best, one.progress.seconds_left) == (None, None)


def test_what_cannot_be_read_or_written_is_left_out(tmp_path: Path) -> None:
    path = progress_path(tmp_path, CONDITION)
    with announced(tmp_path, CONDITION), shared(tmp_path, CONDITION, ignore) as tell:
        tell(COMPILING)
        path.write_bytes(path.read_bytes()[:-9])
        progress_path(tmp_path, OTHER).mkdir()
        assert running(tmp_path) == []
        Path(tmp_path, "running", "no-id.progress").write_bytes(json.encode(Running("no-id", 0.0, TRAINING)))
        for hostile in (b'{"condition": "\xff"}', b'{"x":' + b"[" * 100_000):
            path.write_bytes(hostile)
            assert running(tmp_path) == []
        for odd in (os.mkfifo, Path.mkdir):  # a pipe or a folder in the way keeps nobody from running
            path.unlink()
            odd(path)
            tell(TRAINING)
            assert running(tmp_path) == []


def test_what_a_dead_process_told_is_not_shown_and_is_swept(tmp_path: Path) -> None:
    with announced(tmp_path, CONDITION), shared(tmp_path, CONDITION, ignore) as tell:
        tell(TRAINING)
        left = progress_path(tmp_path, CONDITION).read_bytes()
    path = progress_path(tmp_path, CONDITION)
    path.write_bytes(left)
    assert running(tmp_path) == []
    sweep(tmp_path)
    assert not path.exists()


def test_verify_leaves_the_progress_of_a_batch_that_compiles_for_long(store: Store) -> None:
    store.check_writable()
    with announced(store.root, CONDITION), shared(store.root, CONDITION, ignore) as tell:
        tell(COMPILING)
        path = progress_path(store.root, CONDITION)
        os.utime(path, (1e9, 1e9))
        assert [problem for problem in verify(store, repair=False) if problem.path == path] == []
    path.write_bytes(b"{}")
    os.utime(path, (1e9, 1e9))
    assert [problem.kind for problem in verify(store, repair=False) if problem.path == path] == ["leftover"]
