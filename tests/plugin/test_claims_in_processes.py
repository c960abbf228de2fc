"""`--claims-processes N`: verdicts as in one process, whatever becomes of the processes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from evoclaims.trials.store import Store

BODIES = {
    "a": "supported",
    "b": "refuted",
    "c": "undecided",
    "d": "error",
    "own": "own_number + 1\n    verdict(trials('coin', on='parity').solves_every_level.in_most_trials(p0=0.5))",
}
FIXTURE = "\n\n@pytest.fixture\ndef own_number():\n    return 1\n"


def write(project: Any) -> None:
    """Write claims; what `own` needs is not known beforehand, since it has a fixture of its own."""
    project.write(**BODIES)
    file = project.path / "claims" / "test_claims.py"
    file.write_text(file.read_text().replace("test_own(trials", "test_own(own_number, trials") + FIXTURE)


def test_two_processes_give_the_verdicts_of_one(project: Any) -> None:
    write(project)
    apart = project.run_apart("--claims-processes=2", "--claims-storage=two", "-v")
    alone = project.run("--claims-storage=one", "-v", own_store=True)
    assert (apart.ret, alone.ret) == (1, 1)
    rows = [[line for line in one.outlines if " in small (§1) " in line] for one in (apart, alone)]
    assert rows[0] == rows[1]
    assert len(rows[0]) == len(BODIES)
    digests = [sorted(trial.digest for trial in Store(Path(name)).results([])) for name in ("two", "one")]
    assert digests[0] == digests[1]
    assert len(digests[0]) == 30  # right, wrong and coin


def test_processes_are_asked_for_nothing_where_all_trials_are_there(project: Any) -> None:
    project.write(a="supported", b="refuted")
    result = project.run("--claims-processes=2")
    assert result.parseoutcomes() == {"supported": 1, "refuted": 1, "deselected": 2}


def test_both_tiers_and_a_variant_run_in_processes(project: Any) -> None:
    project.write(a="supported")
    result = project.run("--claims-processes=2", "-m", "smoke or full", "--claims-variant=traded", own_store=True)
    assert result.parseoutcomes()["refuted"] == 2


def test_a_plan_of_fixtures_begins_no_processes(project: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[object] = []
    monkeypatch.setattr("evoclaims.execution.ahead.Ahead.start", lambda *given: begun.append(given))
    project.write(a="supported")
    result = project.run("--claims-processes=2", "--setup-plan", own_store=True)
    assert result.ret == 0
    assert not begun


def test_a_number_that_is_none_is_refused(project: Any, sentence: Any) -> None:
    project.write(a="supported")
    result = project.run("--claims-processes=0", "--collect-only", own_store=True)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    sentence(result, "--claims-processes takes a number from 1 up, or auto")


def test_a_claim_whose_processes_die_is_an_error_and_the_others_are_judged(project: Any) -> None:
    project.write(a="supported", c="undecided")
    paper = project.path / "tiny_paper.py"
    deadly = "    def init(self, key, task):\n        import os; os._exit(9)\n        return jnp.where"
    paper.write_text(paper.read_text().replace("    def init(self, key, task):\n        return jnp.where", deadly))
    result = project.run("--claims-processes=2", own_store=True)
    shown = " ".join(result.stdout.str().split())
    assert "evoclaims: coin on parity: its process died (status 9); it is begun again." in shown
    assert "its process died (status 9), 3 times" in shown
    assert "claims: 1 supported, 1 error" in shown


ENDING = """
import time
from pathlib import Path
import pytest

@pytest.hookimpl(trylast=True)
def pytest_sessionfinish():
    Path("ending").touch()
    time.sleep(1)
"""


def until(file: str) -> None:
    """Wait for a file."""
    deadline = time.monotonic() + 120
    while not Path(file).exists() and time.monotonic() < deadline:
        time.sleep(0.05)


def test_ctrl_c_ends_the_processes_and_another_keeps_pytest_from_no_end(project: Any) -> None:
    project.write(c="undecided")
    (project.path / "conftest.py").write_text(ENDING)
    paper = project.path / "tiny_paper.py"
    slow = (
        "    def init(self, key, task):\n        import os, time; Path('pid').write_text(str(os.getpid()))\n"
        "        os.rename('pid', 'begun')\n"
        "        time.sleep(600)\n        return jnp.where"
    )
    paper.write_text(paper.read_text().replace("    def init(self, key, task):\n        return jnp.where", slow))
    run = subprocess.Popen(
        [sys.executable, "-m", "pytest", "--claims-processes=2", "-q"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    until("begun")
    run.send_signal(signal.SIGINT)
    until("ending")
    run.send_signal(signal.SIGINT)
    output, _ = run.communicate(timeout=60)
    assert run.returncode == pytest.ExitCode.INTERRUPTED
    assert b"KeyboardInterrupt" in output
    assert b"Traceback" not in output
    assert output.count(b"evoclaims: the run is ending; what has run is kept.") == 1
    assert b"\ninterrupted; what has run is kept, and the same command goes on from there\n" in output
    with pytest.raises(ProcessLookupError):
        os.kill(int(Path("begun").read_text()), 0)
