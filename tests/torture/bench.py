"""A project under attack: its processes, what they say, and what they leave in the store."""

from __future__ import annotations

import functools
import itertools
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tortured_project import CLAIMS, METHODS, PYPROJECT, TRIALS

import evoclaims

HERE = Path(__file__).parent
PATIENCE = 300.0
"""Seconds after which what has not happened is taken for a hang; a loaded machine stays far below."""

LEASE = 3.0
"""Seconds that a notice counts for, instead of 60, so that nobody has to wait for long."""


class HangError(Exception):
    """Something that must happen did not."""


def until(happened: Callable[[], Any], what: str) -> Any:
    """Wait until a function returns something true, and return that."""
    end = time.monotonic() + PATIENCE
    while not (found := happened()):
        if time.monotonic() > end:
            raise HangError(f"{what} did not happen within {PATIENCE:.0f} s")
        time.sleep(0.02)
    return found


def is_alive(pid: int) -> bool:
    """Whether a process runs; one that is dead and not yet collected does not."""
    try:
        os.kill(pid, 0)
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except (ProcessLookupError, FileNotFoundError):
        return False


@functools.cache
def hosts_are_real() -> bool:
    """Whether this system lets a process tree have a host name of its own."""
    command = ["unshare", "--uts", "sh", "-c", "echo elsewhere > /proc/sys/kernel/hostname"]
    try:
        return subprocess.run(command, capture_output=True, check=False).returncode == 0
    except OSError:
        return False


@dataclass
class Running:
    """A command under way, the first of its process group."""

    process: subprocess.Popen[bytes]
    output_file: Path
    json_file: Path | None = None

    @property
    def pid(self) -> int:
        return self.process.pid

    @property
    def output(self) -> str:
        return self.output_file.read_text(errors="replace")

    def owns(self, pid: int) -> bool:
        """Whether a process that lives belongs to this command."""
        with suppress(ProcessLookupError):
            return is_alive(pid) and os.getpgid(pid) == self.pid
        return False

    def signal(self, number: int) -> None:
        """Send a signal to every process of the command."""
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self.pid, number)

    def end(self) -> int:
        """Wait for the command's end, and return its status."""
        until(lambda: self.process.poll() is not None, f"the end of {self.process.args!r}")
        return self.process.returncode

    def verdicts(self) -> list[dict[str, Any]]:
        """Return what pytest has written of every claim, but for its evidence's place and what stood there before."""
        if self.json_file is None or not self.json_file.exists():
            return []
        claims = json.loads(self.json_file.read_text())["claims"]
        own = ({name: value for name, value in claim.items() if name not in ("evidence", "before")} for claim in claims)
        return sorted(own, key=lambda claim: str(claim["claim"]))


@dataclass
class Bench:
    """A project in a folder of its own.

    Attributes:
        pause: seconds that a process rests at every report.
        kept: whether the folder is to stay, since something was found.
    """

    folder: Path
    pause: float = 0.08
    kept: bool = False
    started: list[Running] = field(default_factory=list)
    _events: list[dict[str, Any]] = field(default_factory=list)
    _read: int = 0
    _numbers: Iterator[int] = field(default_factory=itertools.count)

    def __post_init__(self) -> None:
        (self.folder / "claims").mkdir(parents=True)
        (self.folder / "pyproject.toml").write_text(PYPROJECT)
        (self.folder / "claims" / "test_claims.py").write_text(CLAIMS)

    @property
    def store(self) -> Path:
        return self.folder / ".evoclaims"

    def pytest(self, workers: int = 2, **surroundings: Any) -> Running:
        """Start pytest with so many workers, 0 for none."""
        name = self.folder / f"verdicts-{next(self._numbers)}.json"
        options = [f"--claims-json={name}", *([f"-n{workers}"] if workers else ())]
        return self._start(["-m", "pytest", *options], json_file=name, **surroundings)

    def evoclaims(self, *arguments: str, **surroundings: Any) -> Running:
        """Start the command line."""
        code = "import sys; from evoclaims.cli import main; sys.exit(main())"
        return self._start(["-c", code, *arguments], **surroundings)

    def _start(
        self,
        arguments: Sequence[str],
        host: str = "",
        clock: Path | None = None,
        json_file: Path | None = None,
    ) -> Running:
        """Start Python in the project, on a host of this name, with a clock that is wrong by what a file says."""
        command = [sys.executable, *arguments]
        source = Path(evoclaims.__file__).parents[1]
        given = filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))
        paths = [HERE / "shims", HERE, HERE.parent / "trials", source, *given]
        environment = {
            **os.environ,
            "PYTHONPATH": os.pathsep.join(map(str, paths)),
            "COLUMNS": "200",
            "TORTURE_LOG": str(self.folder / "log"),
            "TORTURE_PAUSE": str(self.pause),
            "TORTURE_LEASE": str(LEASE),
            **({"TORTURE_CLOCK": str(clock)} if clock else {}),
        }
        for name in ("PYTEST_ADDOPTS", "PYTEST_XDIST_WORKER", "PYTEST_CURRENT_TEST", "GITHUB_STEP_SUMMARY"):
            environment.pop(name, None)
        if host and hosts_are_real():
            renamed = 'echo "$0" > /proc/sys/kernel/hostname; exec "$@"'
            command = ["unshare", "--uts", "sh", "-c", renamed, host, *command]
        elif host:
            environment["TORTURE_HOST"] = host
        output = self.folder / f"output-{next(self._numbers)}.txt"
        with output.open("wb") as file:
            process = subprocess.Popen(
                command, cwd=self.folder, env=environment, stdout=file, stderr=subprocess.STDOUT, start_new_session=True
            )
        self.started.append(Running(process, output, json_file))
        return self.started[-1]

    def events(self) -> list[dict[str, Any]]:
        """Return what the processes have said so far; whoever waits asks often, so that each line is read once."""
        with suppress(FileNotFoundError), (self.folder / "log").open("rb") as file:
            file.seek(self._read)
            *lines, rest = file.read().split(b"\n")
            self._events += [json.loads(line) for line in lines]
            self._read = file.tell() - len(rest)
        return self._events.copy()

    def said(self, what: str, by: Running, since: int = 0) -> list[dict[str, Any]]:
        """Return what the living processes of a command have said of one kind, after so many lines of the log."""
        lines = [line for line in self.events()[since:] if line["what"] == what]
        living = {pid for pid in {line["pid"] for line in lines} if by.owns(pid)}
        return [line for line in lines if line["pid"] in living]

    def until_said(self, what: str, by: Running, times: int = 1) -> None:
        """Wait until a command says something so many times from now on; its end will do as well."""
        since = len(self.events())

        def happened() -> bool:
            return by.process.poll() is not None or len(self.said(what, by, since)) >= times

        until(happened, f"{what!r} of {by.output_file.name}")

    @contextmanager
    def held(self, running: Running) -> Iterator[None]:
        """Keep a command from training on for as long as a `with` block lasts; it lives and beats."""
        path = self.folder / f"log-held-{running.pid}"
        path.touch()
        yield
        path.unlink()

    def records(self) -> dict[str, bytes]:
        """Return the stored trials' files by id."""
        return {path.name.partition(".")[0]: path.read_bytes() for path in (self.store / "trials").glob("??/*.json")}

    def close(self) -> None:
        """End what still runs."""
        for running in self.started:
            running.signal(signal.SIGKILL)
            running.process.wait()


@dataclass(frozen=True)
class Truth:
    """What a run that nothing disturbs comes to: each trial's digest, and all verdicts."""

    digests: dict[str, str]
    verdicts: list[dict[str, Any]]


@dataclass
class Laboratory:
    """Where attacks take place, and the truth that they must not change."""

    folder: Path
    _numbers: Iterator[int] = field(default_factory=itertools.count)

    @contextmanager
    def bench(self, pause: float = 0.08) -> Iterator[Bench]:
        """Give a new project; it goes when nothing was found, and stays to be looked at when something was."""
        bench = Bench(self.folder / f"bench-{next(self._numbers)}", pause)
        try:
            yield bench
        finally:
            bench.close()
        if not bench.kept:
            shutil.rmtree(bench.folder)

    @functools.cached_property
    def truth(self) -> Truth:
        """What a run of everything comes to."""
        with self.bench(pause=0.0) as bench:
            running = bench.pytest(0)
            running.end()
            digests = digests_of(bench.records())
            truth = Truth(digests, running.verdicts())
            outcomes = {claim["outcome"] for claim in truth.verdicts}
            assert len(digests) == TRIALS * len(METHODS), running.output
            assert len(truth.verdicts) == 5, running.output
            assert len(outcomes - {"error"}) > 1, running.output
        return truth


def digests_of(records: dict[str, bytes]) -> dict[str, str]:
    return {name: json.loads(data)["digest"] for name, data in records.items()}
