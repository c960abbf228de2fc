"""A worker process ends with its command alone: neither Ctrl-C nor the command's death leaves something behind."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import msgspec
import pytest
from tiny_project import REPRODUCTION, Evoclaims, Project

from evoclaims.execution.job import Job
from evoclaims.execution.worker import Ended, WorkOrder
from evoclaims.execution.workers import Process

SLOW = """

import time


class Slow(Coin):
    name: ClassVar[str] = "slow"

    def init(self, key, task):
        Path(__file__).with_name("begun").write_text("")
        time.sleep(600)


METHODS = {"slow": Slow()}
"""


def test_a_worker_ends_with_the_command_that_has_started_it(evoclaims: Evoclaims, project: Project) -> None:
    """Closing its input is all that a command does that is killed."""
    head, tail = REPRODUCTION.split("METHODS = {")
    tail = tail.split("\n", 1)[1].replace('method == "right"', "False")
    project.pytester.makepyfile(tiny_paper=head + SLOW + tail)
    worker = subprocess.Popen(
        [sys.executable, "-m", "evoclaims.execution.worker"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )
    assert worker.stdin is not None
    assert worker.stdout is not None
    for line in (WorkOrder(".evoclaims", "smoke", "cpu", 0, 1), Job("", "slow", "parity")):
        worker.stdin.write(msgspec.json.encode(line) + b"\n")
    worker.stdin.flush()
    deadline = time.monotonic() + 120
    while not Path("begun").exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    os.kill(worker.pid, signal.SIGINT)  # Ctrl-C reaches it, too, and is the command's to handle
    assert worker.poll() is None
    worker.stdin.close()
    assert worker.wait(60) == 0
    worker.stdout.close()


def test_ctrl_c_while_a_worker_starts_does_not_end_it(project: Project, capfd: pytest.CaptureFixture[str]) -> None:
    process = Process(WorkOrder(".evoclaims", "smoke", "cpu", 0, 1), {})
    os.kill(process._process.pid, signal.SIGINT)  # before Python, and long before its imports
    assert process.is_ready()
    process.close()
    assert (process._process.returncode, capfd.readouterr().err) == (0, "")
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())  # the command itself still hears it


def test_what_a_process_says_that_cannot_open_the_project_is_why_it_ended(
    project: Project, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is passed on, and read to its end also where nobody can be told: else the process would wait for ever."""
    paper = project.path / "tiny_paper.py"
    noise = "\nimport sys\nprint(*range(99_999), sep=chr(10), file=sys.stderr)\nraise RuntimeError('on strike')"
    paper.write_text(paper.read_text() + noise)
    with open("/dev/full", "w") as full:
        monkeypatch.setattr("sys.stderr", full)
        process = Process(WorkOrder(".evoclaims", "smoke", "cpu", 0, 1), {})
        watchdog = threading.Timer(60.0, process.stop)
        watchdog.start()
        assert not process.is_ready()
        watchdog.cancel()
        process.close()
        with contextlib.suppress(OSError):
            full.close()
    assert process.why().startswith("The module 'tiny_paper', which [tool.evoclaims] names, does not import: Runtime")
    assert "on strike" in process.why()


READER = """    def init(self, key, task):
        import subprocess
        assert subprocess.run(["cat"], stdout=subprocess.PIPE, check=True).stdout == b""
        return jnp.where"""


def test_a_method_that_reads_its_input_takes_no_condition_from_the_worker(project: Project) -> None:
    """Programs that it starts may, such as ffmpeg; they would wait for ever."""
    paper = project.path / "tiny_paper.py"
    begun = "    def init(self, key, task):\n        return jnp.where"
    assert begun in paper.read_text()
    paper.write_text(paper.read_text().replace(begun, READER))
    process = Process(WorkOrder(".evoclaims", "smoke", "cpu", 0, 1), {})
    watchdog = threading.Timer(60.0, process.stop)
    watchdog.start()
    assert process.is_ready()
    for method in ("coin", "right"):
        job = Job("", method, "parity")
        assert process.run(job, lambda text: None) == Ended(job)
    watchdog.cancel()
    process.close()
