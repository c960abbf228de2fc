"""kill -9 at any moment, and processes that share a store: no finished trial is lost, and none is run twice."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from kill_me import CONDITION, SEEDS

from evoclaims.trials.runner import run
from evoclaims.trials.spec import TrialSpec
from evoclaims.trials.store import DamagedFileError, Store

pytestmark = pytest.mark.oldest

SCRIPT = Path(__file__).with_name("kill_me.py")


def _start(root: Path) -> subprocess.Popen[str]:
    """Start the process and wait until it is about to run."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen(
        [sys.executable, str(SCRIPT), str(root)],
        env=environment,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    return process


def _go(process: subprocess.Popen[str]) -> None:
    assert process.stdin is not None
    process.stdin.write("go\n")
    process.stdin.flush()


def _ended(process: subprocess.Popen[str]) -> list[str]:
    """Return the lines of a process that came to its end."""
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    return out.splitlines()


def _killed(process: subprocess.Popen[str], delay: float) -> list[str]:
    """Kill the process `delay` seconds after its first report, and return its lines."""
    assert process.stdout is not None
    lines = []
    while not lines or not lines[-1].startswith("training"):
        lines.append(process.stdout.readline().strip())
        assert process.poll() is None or lines[-1]
    time.sleep(delay)
    process.kill()
    out, _ = process.communicate(timeout=300)
    assert process.returncode == -signal.SIGKILL
    return lines + out.splitlines()


def _steps(lines: list[str]) -> list[int]:
    return [int(line.split()[1]) for line in lines if line.startswith("training")]


def _stored(lines: list[str]) -> Counter[int]:
    return Counter(int(line.split()[1]) for line in lines if line.startswith("put ") and line.endswith(" stored"))


@pytest.fixture(scope="module")
def digests(tmp_path_factory: pytest.TempPathFactory, cpus: list[Any]) -> str:
    """The line that a run prints at its end."""
    results = run(CONDITION, SEEDS, Store(tmp_path_factory.mktemp("whole")), cpus)
    assert len({result.metrics["steps"] for result in results}) > 3
    return "digests " + " ".join(result.digest for result in results)


def test_a_run_killed_at_any_moment_goes_on_and_repeats_nothing(store: Store, digests: str) -> None:
    draw = random.Random()
    delays = [draw.uniform(0.0, 0.5), draw.uniform(0.0, 0.4)]
    runs = []
    for delay in delays:
        process = _start(store.root)
        _go(process)
        runs.append(_killed(process, delay))
        finished = set(store.ids())
        said = {TrialSpec(CONDITION, seed).id for lines in runs for seed in _stored(lines)}
        assert said <= finished, f"lost with delays {delays}"
        errors: list[DamagedFileError] = []
        assert {result.id for result in store.results(errors)} == finished
        assert errors == []
    process = _start(store.root)
    _go(process)
    runs.append(_ended(process))
    assert runs[-1][-1] == digests, f"other bits with delays {delays}"
    stored = sum((_stored(lines) for lines in runs), Counter[int]())
    assert max(stored.values()) == 1, f"repeated with delays {delays}"
    for before, after in pairwise(runs):
        assert after[0].startswith("resuming")
        # Each report follows the checkpoint of its chunk, and the kill may come between the two.
        assert _steps(after)[0] >= _steps(before)[-1]
    assert not list(store.checkpoints.glob("*.npz"))


def test_processes_that_share_a_store_run_every_trial_once(store: Store, digests: str) -> None:
    processes = [_start(store.root) for _ in range(2)]
    for process in processes:
        _go(process)
    lines = [_ended(process) for process in processes]
    assert [said[-1] for said in lines] == [digests, digests]
    puts = Counter(line.split()[1] for said in lines for line in said if line.startswith("put "))
    assert puts == Counter(map(str, SEEDS))
    assert sum(any(line.startswith("waiting for process") for line in said) for said in lines) == 1
    assert not list((store.root / "running").iterdir())
