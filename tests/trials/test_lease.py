"""Leases keep processes from running the same trials twice, and a dead process never keeps others waiting."""

from __future__ import annotations

import errno
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import filelock
import pytest

from evoclaims.claims.fetching import RunMissing
from evoclaims.core.errors import UserError
from evoclaims.trials import lease as leases
from evoclaims.trials.lease import announced, lease_path, sweep
from evoclaims.trials.progress import ignore
from evoclaims.trials.store import Store

pytestmark = pytest.mark.oldest

CONDITION, OTHER = "c0" * 32, "0c" * 32
GONE = 2**22 + 1
SCRIPT = """
import sys
from pathlib import Path
from evoclaims.trials.lease import announced

def tell(text):
    print("waits", flush=True)
    sys.exit()

with announced(Path(sys.argv[1]), sys.argv[2], tell):
    print("runs", flush=True)
    sys.stdin.readline()
"""


def start(root: Path) -> subprocess.Popen[str]:
    """Start a process that announces the condition and then waits for a line, or says that it has to wait and ends."""
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
    assert process.stdout.readline() == "runs\n"
    yield process
    process.kill()
    process.communicate()


@pytest.fixture
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leases count for half a second, and are refreshed ten times in it."""
    monkeypatch.setattr(leases, "FRESH_SECONDS", 0.5)
    monkeypatch.setattr(leases, "REFRESH_SECONDS", 0.05)


def forge(root: Path, condition: str = CONDITION, **fields: Any) -> Path:
    """Write a lease as filelock does, of another process on another host unless the fields say otherwise."""
    plain = {"pid": 1, "host": "elsewhere", "mode": "lease", "token": "a" * 32, "duration": leases.FRESH_SECONDS}
    path = lease_path(root, condition)
    path.parent.mkdir(exist_ok=True)
    path.write_text("\n".join(["filelock/2", *(f"{name}={value}" for name, value in {**plain, **fields}.items()), ""]))
    return path


def waits(root: Path, **options: Any) -> list[str]:
    """Announce the condition, and return what was said while waiting."""
    said: list[str] = []
    with announced(root, CONDITION, said.append, **options):
        pass
    return said


def never(seconds: float) -> None:
    pytest.fail("waited")


def test_a_notice_says_who_runs_the_condition_and_goes_with_the_block_also_when_that_fails(tmp_path: Path) -> None:
    def fails() -> None:
        with announced(tmp_path, CONDITION, sleep=never):
            owner = filelock.SoftFileLease(lease_path(tmp_path, CONDITION)).owner
            assert owner is not None
            assert (owner.pid, owner.hostname.partition("?")[0]) == (os.getpid(), socket.gethostname())
            assert waits(tmp_path, sleep=never) == []  # nobody waits for its own process
            assert lease_path(tmp_path, CONDITION).exists()
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fails()
    assert list((tmp_path / "running").iterdir()) == []


def test_a_process_waits_for_another_that_lives_and_says_for_whom(
    tmp_path: Path, runner: subprocess.Popen[str]
) -> None:
    slept = []

    def sleep(seconds: float) -> None:
        slept.append(seconds)
        if len(slept) == 3:
            runner.communicate("done\n")

    said = waits(tmp_path, sleep=sleep)
    assert slept == [0.2] * 3
    who = f"process {runner.pid} on {socket.gethostname()}"
    assert said == [f"waiting for {who}, which runs the same condition"] * 3


@pytest.mark.parametrize("collected", [True, False], ids=["collected", "zombie"])
def test_a_killed_process_keeps_nobody_waiting(tmp_path: Path, runner: subprocess.Popen[str], collected: bool) -> None:
    runner.send_signal(signal.SIGKILL)
    if collected:
        runner.wait()
    else:
        os.waitid(os.P_PID, runner.pid, os.WEXITED | os.WNOWAIT)
    assert lease_path(tmp_path, CONDITION).exists()
    assert waits(tmp_path, sleep=never) == []
    assert list((tmp_path / "running").iterdir()) == []


def test_processes_that_start_together_agree_on_one(tmp_path: Path) -> None:
    forge(tmp_path, pid=GONE, host=filelock_host(tmp_path))  # a killed run has left its lease: all want to take it over
    processes = [start(tmp_path) for _ in range(3)]
    said = [process.stdout.readline().strip() for process in processes if process.stdout]
    for process in processes:
        process.communicate("done\n")
    assert sorted(said) == ["runs", "waits", "waits"]


@pytest.mark.parametrize("wrong", [-3600.0, 3600.0])  # an hour, by which the other host's clock is wrong
def test_a_notice_of_another_host_counts_until_it_is_refreshed_no_more(
    tmp_path: Path, hasty: None, wrong: float
) -> None:
    path = forge(tmp_path)
    os.utime(path, (time.time() + wrong,) * 2)
    start, beats = time.monotonic(), iter(range(10))

    def sleep(seconds: float) -> None:
        time.sleep(0.1)
        if next(beats, None) is not None:
            os.utime(path, (time.time() + wrong,) * 2)

    assert "process 1 on elsewhere" in waits(tmp_path, sleep=sleep)[0]
    assert 1.5 < time.monotonic() - start < 30.0


@pytest.mark.parametrize("kind", ["stale", "ended"])
def test_where_files_cannot_be_exchanged_a_stale_notice_goes_too(
    tmp_path: Path, hasty: None, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    """As on network folders, on which filelock leaves every lease where it is."""
    for module in ("_soft", "_util"):
        monkeypatch.setattr(f"filelock.{module}.exchange_names", lambda *names: False, raising=False)
    ended = {"host": filelock_host(tmp_path), "pid": GONE}
    forge(tmp_path, **(ended if kind == "ended" else {}))
    assert bool(waits(tmp_path)) is (kind == "stale")


def filelock_host(root: Path) -> str:
    """Return the name that filelock gives this machine."""
    with announced(root, OTHER):
        owner = filelock.SoftFileLease(lease_path(root, OTHER)).owner
        assert owner is not None
        return owner.hostname


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="processes cannot be stopped here")
def test_a_stopped_process_keeps_others_waiting_no_longer_than_one_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, runner: subprocess.Popen[str]
) -> None:
    runner.send_signal(signal.SIGSTOP)
    os.waitid(os.P_PID, runner.pid, os.WSTOPPED | os.WNOWAIT)
    clock = time.monotonic
    slept = 0.0

    def sleep(seconds: float) -> None:
        nonlocal slept
        slept += 10.0
        monkeypatch.setattr(time, "monotonic", lambda: clock() + slept)

    assert 6 <= len(waits(tmp_path, sleep=sleep)) <= 8
    runner.send_signal(signal.SIGCONT)


def test_a_notice_is_refreshed_until_another_process_has_taken_it_over(tmp_path: Path, hasty: None) -> None:
    """Nobody calls anything here: while XLA computes, the process does nothing else."""
    path = lease_path(tmp_path, CONDITION)
    with announced(tmp_path, CONDITION):
        os.utime(path, (1.0, 1.0))
        end = time.monotonic() + 60.0
        while path.stat().st_mtime == 1.0:
            assert time.monotonic() < end
            time.sleep(0.01)
        path.unlink()
        forge(tmp_path)
        os.utime(path, (1.0, 1.0))
        time.sleep(0.3)
        assert path.stat().st_mtime == 1.0
    assert path.exists()


@pytest.mark.parametrize("text", ["", '{"pid": 1}', "\x00\xff", "filelock/2\npid=-1\n"])
def test_a_text_that_is_no_notice_is_stale(tmp_path: Path, hasty: None, text: str) -> None:
    forge(tmp_path).write_text(text)
    assert set(waits(tmp_path)) == {"waiting for another process, which runs the same condition"}


@pytest.mark.parametrize("make", [Path.mkdir, os.mkfifo, lambda path: path.symlink_to(path)])
def test_an_odd_file_where_a_notice_belongs_keeps_nobody_waiting_for_ever(
    tmp_path: Path, hasty: None, make: Callable[[Path], None]
) -> None:
    path = lease_path(tmp_path, CONDITION)
    path.parent.mkdir()
    make(path)
    sweep(tmp_path)
    waits(tmp_path)


@pytest.mark.parametrize("name", ["open", "mkdir"])
def test_a_store_that_takes_no_notices_stops_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    def refuse(*arguments: Any, **options: Any) -> None:
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr(os, name, refuse)
    assert waits(tmp_path, sleep=never) == []
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_a_text_that_is_no_condition_reaches_no_file(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="64 lower-case hexadecimal digits"), announced(tmp_path, "../../evil"):
        pass


def test_notices_of_processes_that_are_gone_are_swept_and_the_others_stay(
    tmp_path: Path, runner: subprocess.Popen[str]
) -> None:
    gone = forge(tmp_path, "ab" * 32, pid=GONE, host=filelock_host(tmp_path))
    elsewhere = forge(tmp_path, "cd" * 32)
    sweep(tmp_path)
    assert not gone.exists()
    assert {path.name for path in (tmp_path / "running").iterdir()} == {elsewhere.name, f"{CONDITION}.lock"}


def test_who_ends_a_condition_or_has_nothing_to_run_sweeps_too(tmp_path: Path) -> None:
    Store(tmp_path).check_writable()
    for sweeps in (lambda: waits(tmp_path), RunMissing(Store(tmp_path), "cpu", ignore).check):
        gone = forge(tmp_path, OTHER, pid=GONE, host=filelock_host(tmp_path))
        sweeps()
        assert not gone.exists()


@pytest.mark.skipif(not Path("/proc/self/ns/pid").exists(), reason="only Linux numbers processes anew in containers")
@pytest.mark.parametrize("inside", [True, False])
def test_a_container_with_the_hosts_name_breaks_no_notice_of_the_host_or_of_another_container(
    inside: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = forge(tmp_path, OTHER, pid=GONE, host=socket.gethostname())  # as filelock writes it on the host itself
    other = forge(tmp_path, CONDITION, pid=GONE, host=f"{socket.gethostname()}?pidns-1")
    monkeypatch.setattr(leases, "_INITIAL", 1 if inside else os.stat("/proc/self/ns/pid").st_ino)
    sweep(tmp_path)
    assert path.exists() is inside
    assert other.exists()


@pytest.mark.skipif(not Path("/proc/self/ns/pid").exists(), reason="only Linux tells which processes there are")
def test_a_process_that_proc_hides_has_not_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = forge(tmp_path, OTHER, pid=os.getpid(), host=filelock_host(tmp_path))

    def hidden(self: Path, **_: str) -> str:
        raise FileNotFoundError(self)

    monkeypatch.setattr(Path, "read_text", hidden)
    sweep(tmp_path)
    assert path.exists()


def test_a_folder_that_cannot_be_swept_stops_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(path: Path) -> None:
        raise OSError(errno.EROFS, "Read-only file system")

    forge(tmp_path, OTHER, pid=GONE, host=filelock_host(tmp_path))
    monkeypatch.setattr(Path, "unlink", refuse)
    sweep(tmp_path)
    sweep(tmp_path / "none")
