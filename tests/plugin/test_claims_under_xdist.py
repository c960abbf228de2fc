"""Under pytest-xdist the verdicts are the same, the controller shows them, and no trial is run twice."""

from __future__ import annotations

import json
from typing import Any

import pytest

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


def test_workers_give_the_verdicts_of_one_process_and_run_each_trial_once(project: Any) -> None:
    project.write(**BODIES)
    (project.path / "conftest.py").write_text(SPY)
    apart = project.run_apart("-n2", "--claims-json=out.json", "--junitxml=out.xml")
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
    }
    apart.stdout.fnmatch_lines(["claims: 2 supported, 1 refuted, 1 inconclusive, 1 error"])
    assert (project.path / "out.xml").read_text().count('name="verdict"') == len(BODIES)
    (project.path / "conftest.py").unlink()
    alone = project.run(own_store=True)
    rows = [[line for line in result.outlines if line[:2] in {f"{n} " for n in BODIES}] for result in (alone, apart)]
    assert rows[0] == rows[1]
    assert len(rows[0]) == len(BODIES)


def test_a_claim_whose_process_dies_is_not_missing_without_a_word(project: Any) -> None:
    kill = "import os, signal; os.kill(os.getpid(), signal.SIGKILL)"
    project.write(a="supported", killed=kill)
    apart = project.run_apart("-n1", "--claims-json=out.json")
    assert apart.ret == pytest.ExitCode.TESTS_FAILED
    shown = " ".join(apart.stdout.str().split())
    assert "error: The process that judged claims/test_claims.py::test_killed[smoke] died" in shown
    assert "claims: 1 supported" in shown
    project.write(killed=kill)
    apart = project.run_apart("-n1")
    assert apart.ret == pytest.ExitCode.TESTS_FAILED
    assert "ERROR: The process that judged claims/test_claims.py::test_killed[smoke] died" in apart.stdout.str()


@pytest.mark.parametrize(
    ("argument", "text"),
    [
        ("--claims-only=nope", "There is no claim named 'nope'. Known: a."),
        ("--claims-device=gpu", "finds no hardware for the device 'gpu'"),
    ],
)
def test_a_wrong_value_is_one_sentence_under_xdist_too(project: Any, sentence: Any, argument: str, text: str) -> None:
    project.write(a="supported")
    result = project.run_apart("-n1", argument)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    sentence(result, text)
    assert result.stdout.str().count(text) == 1
