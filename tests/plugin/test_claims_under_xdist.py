"""Under pytest-xdist the verdicts are the same, the controller shows them, and no trial is run twice."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tiny_project import Evoclaims

from evoclaims.judging.verdict import Outcome
from evoclaims.verdicts import history

SPY = """
import os
from evoclaims.trials.store import Store
put = Store.put

def telling(self, result, champion):
    became = put(self, result, champion)
    with open("puts.log", "a") as log:
        log.write(f"{result.id} {became}\\n")
    return became

Store.put = telling
"""

BODIES = {"a": "supported", "b": "refuted", "c": "undecided", "d": "supported", "e": "error"}
SKIPPED = "pytest.skip('later')"
FILE = Path("verdicts.toml")


def test_workers_give_the_verdicts_of_one_process_and_run_each_trial_once(
    project: Any, evoclaims: Evoclaims, sentence: Any
) -> None:
    """What is skipped is known to the controller, and so is a regression, and a claim that is gone."""
    evoclaims("accept", "--tier=smoke", f"--storage={project.store}")
    accepted = history.load(FILE)
    was = replace(accepted["smoke", "a"][0], outcome=Outcome.REFUTED)
    FILE.write_text(history.dump({("smoke", "a"): (was,), ("smoke", "z"): (was,)}))
    project.write(**BODIES, f=SKIPPED)
    (project.path / "conftest.py").write_text(SPY)
    fail = "--claims-compare-fail=refuted->supported"
    apart = project.run_apart("-n2", "--claims-json=out.json", "--junitxml=out.xml", fail)
    assert apart.ret == 1
    puts = (project.path / "puts.log").read_text().split("\n")[:-1]
    assert sorted(puts) == sorted(set(puts))
    assert len(puts) == 30  # right, wrong and coin; two claims share the first
    plain = json.loads((project.path / "out.json").read_text())
    assert {r["claim"]: r["outcome"] for r in plain["claims"]} == {
        "a": "supported",
        "b": "refuted",
        "c": "inconclusive",
        "d": "supported",
        "e": "error",
        "f": "not run",
    }
    sentence(apart, "claims: 2 supported, 1 refuted, 1 inconclusive, 1 error, 1 not run")
    sentence(apart, "- f: its test was skipped (later)")
    sentence(apart, "REGRESSION a (smoke): refuted -> supported")
    sentence(apart, "z (smoke): gone; it was refuted")
    assert (project.path / "out.xml").read_text().count('name="verdict"') == len(BODIES)
    (project.path / "conftest.py").unlink()
    alone = project.run(own_store=True)
    rows = [[line for line in result.outlines if line[:3] in {f"{n}  " for n in BODIES}] for result in (alone, apart)]
    assert rows[0] == rows[1]
    assert len(rows[0]) == len(BODIES)


def test_a_claim_whose_process_dies_is_not_missing_without_a_word(project: Any) -> None:
    project.write(a="supported", killed="import os, signal; os.kill(os.getpid(), signal.SIGKILL)")
    apart = project.run("-n1", own_store=True)
    assert apart.ret == pytest.ExitCode.TESTS_FAILED
    shown = " ".join(apart.stdout.str().split())
    assert "error: The process that judged claims/test_claims.py::test_killed[killed-smoke] died" in shown
    assert "claims: 1 supported" in shown


def test_a_process_that_dies_over_the_only_claim_is_an_error_too(project: Any) -> None:
    """The controller is told so by xdist's hook, called here by hand."""
    project.write("def test_nothing():\n    pass\n")
    (project.path / "conftest.py").write_text(
        "def pytest_sessionfinish(session):\n"
        "    summary = session.config.pluginmanager.get_plugin('claims-summary')\n"
        "    summary.pytest_handlecrashitem('claims/test_claims.py::test_dead[killed-smoke]')\n"
    )
    result = project.run()
    result.stdout.fnmatch_lines(
        ["ERROR: The process that judged claims/test_claims.py::test_dead[[]killed-smoke] died*"]
    )


def test_what_keeps_workers_from_beginning_is_one_sentence_of_the_controllers(project: Any, sentence: Any) -> None:
    project.write(a="supported")
    with (project.path / "tiny_paper.py").open("a") as file:
        file.write("def f(:\n")
    result = project.run("-n2", own_store=True)
    text = "which [tool.evoclaims] names, does not import: SyntaxError: invalid syntax"
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    sentence(result, text)
    assert " ".join(result.stdout.str().split()).count(text) == 1


FAKE_HOST = """
import importlib.metadata
import os

found = importlib.metadata.entry_points
importlib.metadata.entry_points = lambda **names: (
    [type("Plugin", (), {"name": "xla_cuda12"})] if names.get("group") == "jax_plugins" else found(**names)
)
os.environ.setdefault("CUDA_VISIBLE_DEVICES", "GPU-a,GPU-b")
"""


def test_workers_that_would_share_gpus_run_nothing(
    project: Any, sentence: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """jax's plugin for CUDA is planted."""
    project.write(a="supported", b="refuted")
    (project.path / "fake_host.py").write_text(FAKE_HOST)
    for name in ("JAX_PLATFORMS", "CUDA_VISIBLE_DEVICES", "PYTEST_XDIST_WORKER"):  # the run around may set it
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("PYTHONPATH", str(project.path), prepend=":")
    result = project.run_apart("-p", "fake_host", "-n2")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    sentence(result, "Each worker of pytest-xdist would take the memory of this host's GPUs. Leave out -n")
    assert not (project.path / ".evoclaims").exists()


def test_workers_start_no_processes_of_their_own(project: Any, sentence: Any) -> None:
    project.write(a="supported")
    result = project.run("-n1", "--claims-processes=2", own_store=True)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    sentence(result, "Workers of pytest-xdist run trials themselves: leave out -n, or --claims-processes.")
