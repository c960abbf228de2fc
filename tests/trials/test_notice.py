"""Notices keep processes from running the same trials twice, and a dead process never keeps others waiting."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from evoclaims.claims.fetching import RunMissing
from evoclaims.core.errors import UserError
from evoclaims.report.live_line import describe
from evoclaims.trials import notice as notices
from evoclaims.trials.notice import (
    FRESH_SECONDS,
    Notice,
    fresh,
    notice_path,
    running_elsewhere,
    sweep,
    wait_while_others_run,
)
from evoclaims.trials.progress import RunProgress, ignore
from evoclaims.trials.store import Store

CONDITION = "c0" * 32
HOSTS = (("gone", socket.gethostname()), ("old", "elsewhere"), ("young", "elsewhere"))
SCRIPT = (
    "import sys; from pathlib import Path; from evoclaims.trials.notice import Notice\n"
    "with Notice(Path(sys.argv[1]), sys.argv[2]) as notice:\n"
    "    print('other' if notice.other else 'held', flush=True); sys.stdin.readline()\n"
)


def start(root: Path) -> subprocess.Popen[str]:
    """Start a process that announces the condition and then waits for a line."""
    return subprocess.Popen(
        [sys.executable, "-c", SCRIPT, str(root), CONDITION],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


@pytest.fixture
def runner(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    """Another process that is running the condition."""
    process = start(tmp_path)
    assert process.stdout is not None
    assert process.stdout.readline() == "held\n"
    yield process
    process.kill()
    process.communicate()


def forge(root: Path, **changes: Any) -> Path:
    """Write a notice as this process would, with some fields changed."""
    path = notice_path(root, CONDITION)
    with Notice(root, CONDITION):
        plain = json.loads(path.read_text())
    path.write_text(json.dumps({**plain, **changes}))
    return path


def never(seconds: float) -> None:
    pytest.fail("waited")


def test_a_notice_says_who_runs_the_condition_and_goes_with_the_block(tmp_path: Path) -> None:
    with Notice(tmp_path, CONDITION) as notice:
        assert notice.held
        assert notice.other is None
        said = fresh(notice.path)
        assert said is not None
        assert (said.pid, said.host) == (os.getpid(), socket.gethostname())
    assert list((tmp_path / "running").iterdir()) == []


def test_a_notice_goes_when_the_block_fails(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), Notice(tmp_path, CONDITION):
        raise ZeroDivisionError
    assert list((tmp_path / "running").iterdir()) == []


def test_nobody_waits_where_nobody_runs(tmp_path: Path) -> None:
    assert wait_while_others_run(tmp_path, CONDITION, sleep=never) is False


def test_nobody_waits_for_its_own_process(tmp_path: Path) -> None:
    with Notice(tmp_path, CONDITION):
        assert wait_while_others_run(tmp_path, CONDITION, sleep=never) is False


def test_a_process_waits_for_another_that_lives_and_says_for_whom(
    tmp_path: Path, runner: subprocess.Popen[str]
) -> None:
    said: list[str] = []

    def sleep(seconds: float) -> None:
        assert seconds == 0.2
        if len(said) == 3:
            runner.communicate("done\n")

    assert wait_while_others_run(tmp_path, CONDITION, said.append, sleep=sleep) is True
    assert len(said) == 3
    assert f"waiting for process {runner.pid} on {socket.gethostname()}" in said[0]


def test_the_notice_of_a_live_process_is_left_alone(tmp_path: Path, runner: subprocess.Popen[str]) -> None:
    with Notice(tmp_path, CONDITION) as notice:
        assert not notice.held
        other = notice.other
        assert other is not None
        assert other.pid == runner.pid
    assert running_elsewhere(tmp_path, CONDITION) == other


@pytest.mark.parametrize("collected", [True, False], ids=["collected", "zombie"])
def test_a_killed_process_keeps_nobody_waiting(tmp_path: Path, runner: subprocess.Popen[str], collected: bool) -> None:
    runner.send_signal(signal.SIGKILL)
    if collected:
        runner.wait()
    else:
        os.waitid(os.P_PID, runner.pid, os.WEXITED | os.WNOWAIT)
    assert notice_path(tmp_path, CONDITION).exists()
    assert wait_while_others_run(tmp_path, CONDITION, sleep=never) is False
    with Notice(tmp_path, CONDITION) as notice:
        assert notice.held
    assert list((tmp_path / "running").iterdir()) == []


def test_processes_that_start_together_agree_on_one(tmp_path: Path) -> None:
    forge(tmp_path, pid=2**22 + 1)  # a killed run has left its notice: all of them want to take it over
    processes = [start(tmp_path) for _ in range(4)]
    said = [process.stdout.readline().strip() for process in processes if process.stdout]
    for process in processes:
        process.communicate("done\n")
    assert sorted(said) == ["held", "other", "other", "other"]


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="only Linux tells when a process started")
def test_a_later_process_with_the_same_number_keeps_nobody_waiting(
    tmp_path: Path, runner: subprocess.Popen[str]
) -> None:
    forge_at = notice_path(tmp_path, CONDITION)
    plain = json.loads(forge_at.read_text())
    assert fresh(forge_at) is not None
    forge_at.write_text(json.dumps({**plain, "born": str(int(plain["born"]) - 1)}))
    assert fresh(forge_at) is None


@pytest.mark.parametrize(("age", "waits"), [(0.0, True), (FRESH_SECONDS + 5, False), (-FRESH_SECONDS - 5, False)])
def test_a_notice_of_another_host_counts_while_it_is_refreshed(tmp_path: Path, age: float, waits: bool) -> None:
    path = forge(tmp_path, host="elsewhere", pid=1)
    os.utime(path, (time.time() - age,) * 2)
    assert (running_elsewhere(tmp_path, CONDITION) is not None) is waits


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="only Linux tells that a process is stopped")
def test_a_stopped_process_keeps_others_waiting_no_longer_than_one_elsewhere(
    tmp_path: Path, runner: subprocess.Popen[str]
) -> None:
    path = notice_path(tmp_path, CONDITION)
    runner.send_signal(signal.SIGSTOP)
    os.waitid(os.P_PID, runner.pid, os.WSTOPPED | os.WNOWAIT)
    assert running_elsewhere(tmp_path, CONDITION) is not None
    os.utime(path, (time.time() - FRESH_SECONDS - 5,) * 2)
    assert running_elsewhere(tmp_path, CONDITION) is None
    runner.send_signal(signal.SIGCONT)
    os.waitid(os.P_PID, runner.pid, os.WCONTINUED | os.WNOWAIT)
    assert running_elsewhere(tmp_path, CONDITION) is not None


def test_a_refresh_makes_the_notice_young_again(tmp_path: Path) -> None:
    with Notice(tmp_path, CONDITION) as notice:
        os.utime(notice.path, (1.0, 1.0))
        notice.refresh()
        assert notice.path.stat().st_mtime > 1e9


def test_a_notice_stays_young_through_a_chunk_of_any_length(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody calls `refresh` here: while XLA computes, the process does nothing else."""
    monkeypatch.setattr(notices, "REFRESH_SECONDS", 0.001)
    refreshed = threading.Event()
    utime = os.utime

    def telling(path: Path, *times: Any) -> None:
        utime(path, *times)
        if not times:
            refreshed.set()

    with Notice(tmp_path, CONDITION) as notice:
        monkeypatch.setattr(os, "utime", telling)
        os.utime(notice.path, (1.0, 1.0))
        refreshed.clear()
        assert refreshed.wait(60)
        assert notice.path.stat().st_mtime > 1e9
    assert "evoclaims heartbeat" not in [thread.name for thread in threading.enumerate()]


def test_who_does_not_hold_the_notice_refreshes_nothing(tmp_path: Path, runner: subprocess.Popen[str]) -> None:
    with Notice(tmp_path, CONDITION) as notice:
        assert not notice.held
        assert "evoclaims heartbeat" not in [thread.name for thread in threading.enumerate()]


def test_a_refresh_never_keeps_anothers_notice_alive(tmp_path: Path) -> None:
    with Notice(tmp_path, CONDITION) as notice:
        path = forge_in_place(notice, host="elsewhere", token="another")
        notice.refresh()
        assert path.stat().st_mtime == 1.0
        os.utime(path)  # the other has refreshed it
    assert path.exists()


def forge_in_place(notice: Notice, **changes: Any) -> Path:
    """Replace a notice that is held by another's, last refreshed long ago."""
    notice.path.write_text(json.dumps({**json.loads(notice.path.read_text()), **changes}))
    os.utime(notice.path, (1.0, 1.0))
    return notice.path


@pytest.mark.parametrize(
    "text",
    ["", "{", "[]", "{}", '{"pid": 1}', "[" * 100_000, "\x00\xff"],
)
def test_a_text_that_is_no_notice_is_stale(tmp_path: Path, text: str) -> None:
    path = forge(tmp_path)
    path.write_text(text)
    assert fresh(path) is None
    with Notice(tmp_path, CONDITION) as notice:
        assert notice.held


@pytest.mark.parametrize(
    "changes",
    [{"pid": 0}, {"pid": -1}, {"pid": True}, {"pid": "1"}, {"pid": 10**30}, {"host": 3}, {"token": None}, {"x": "y"}],
    ids=str,
)
def test_a_notice_with_a_field_of_the_wrong_kind_is_stale(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changes: dict[str, Any]
) -> None:
    kill = os.kill
    asked = []
    monkeypatch.setattr(os, "kill", lambda pid, number: (asked.append(pid), kill(pid, number)))
    assert fresh(forge(tmp_path, **changes)) is None
    assert all(pid > 0 for pid in asked)  # 0 and below would address whole groups of processes


def test_a_notice_that_was_taken_over_in_the_meantime_is_put_back(
    tmp_path: Path, runner: subprocess.Popen[str]
) -> None:
    path = notice_path(tmp_path, CONDITION)
    before = path.read_text()
    notices._clear(path)
    assert path.read_text() == before
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize("name", ["link", "mkdir"])
def test_a_store_that_takes_no_notices_stops_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    def refuse(*arguments: Any, **options: Any) -> None:
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(os, name, refuse)
    with Notice(tmp_path, CONDITION) as notice:
        notice.refresh()
        assert not notice.held
        assert notice.other is None
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_a_text_that_is_no_condition_reaches_no_file(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="64 lower-case hexadecimal digits"), Notice(tmp_path, "../../evil"):
        pass


def test_control_characters_of_a_notice_never_reach_the_terminal(tmp_path: Path) -> None:
    path = forge(tmp_path, host="\x1b[31m\nhost", pid=1)
    said: list[str] = []
    wait_while_others_run(tmp_path, CONDITION, said.append, sleep=lambda seconds: path.unlink())
    assert said
    assert describe(RunProgress("neat on parity", said[0], 10)).isprintable()


def announce(root: Path, name: str, **changes: Any) -> Path:
    """Write a notice of another condition, as this process would but for some fields."""
    plain = {"pid": os.getpid(), "host": socket.gethostname(), "started": "now", "born": "never", "token": "0"}
    path = notice_path(root, hashlib.sha256(name.encode()).hexdigest())
    path.parent.mkdir(exist_ok=True)
    path.write_text(json.dumps({**plain, **changes}))
    return path


def test_notices_of_processes_that_are_gone_are_swept_and_the_others_stay(
    tmp_path: Path, runner: subprocess.Popen[str]
) -> None:
    _, old, young = (announce(tmp_path, name, host=host) for name, host in HOSTS)
    os.utime(old, (0, 0))
    torn = announce(tmp_path, "torn")
    torn.write_text("{")
    sweep(tmp_path)
    assert {path.name for path in (tmp_path / "running").iterdir()} == {young.name, f"{CONDITION}.json"}
    assert running_elsewhere(tmp_path, CONDITION) is not None


def test_a_condition_that_ends_leaves_no_stale_notice_of_others(tmp_path: Path) -> None:
    gone = announce(tmp_path, "gone")
    with Notice(tmp_path, CONDITION):
        assert gone.exists()
    assert list((tmp_path / "running").iterdir()) == []


def test_a_run_that_has_nothing_to_run_sweeps_too(tmp_path: Path) -> None:
    gone = announce(tmp_path, "gone")
    RunMissing(Store(tmp_path), "cpu", ignore).check()
    assert not gone.exists()


def test_a_folder_that_cannot_be_swept_stops_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*arguments: Any) -> None:
        raise OSError(errno.EROFS, "Read-only file system")

    gone = announce(tmp_path, "gone")
    monkeypatch.setattr(os, "rename", refuse)
    sweep(tmp_path)
    assert gone.exists()
    sweep(tmp_path / "none")
