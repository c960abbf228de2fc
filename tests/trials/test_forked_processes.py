"""A process that was forked after jax had started ends with a sentence, where jax would wait for ever."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import Any

import pytest

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="processes cannot be forked here")

SENTENCE = "This process was forked from one in which jax had started"


SCRIPT = """
import os, sys

def forked():
    if os.fork() == 0:
        from evoclaims.core.errors import UserError
        from evoclaims.trials import devices
        try:
            print(len(devices.choose("cpu")) > 0, flush=True)
        except UserError as error:
            print(error, flush=True)
        os._exit(0)
    os.wait()

forked()
import jax
jax.devices()
forked()
"""


def test_child_is_refused_by_what_had_started_and_not_by_what_was_imported() -> None:
    """Before jax has started a fork does no harm; after that it does, also where only the child imports evoclaims."""
    command = [sys.executable, "-W", "ignore", "-c", SCRIPT]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    before, after = done.stdout.splitlines()
    assert before == "True"
    assert after.startswith(SENTENCE)


FORKING = """
import json, os, warnings
from pathlib import Path
from _pytest.runner import runtestprotocol

def pytest_runtest_protocol(item, nextitem):
    file, hook = Path('reports.json'), item.config.hook
    with warnings.catch_warnings(action='ignore'):
        child = os.fork()
    if child == 0:
        reports = runtestprotocol(item, nextitem=nextitem, log=False)
        file.write_text(json.dumps(
            [hook.pytest_report_to_serializable(config=item.config, report=report) for report in reports]
        ))
        os._exit(0)
    os.waitpid(child, 0)
    for data in json.loads(file.read_text()):
        hook.pytest_runtest_logreport(report=hook.pytest_report_from_serializable(config=item.config, data=data))
    return True
"""


def test_claims_that_a_plugin_forks_end_with_a_sentence_unless_their_trials_are_stored(project: Any) -> None:
    project.write(a="supported", b="refuted")
    (project.path / "conftest.py").write_text(FORKING)
    claims = project.json()["claims"]
    assert [claim["outcome"] for claim in claims] == ["error", "error"]
    assert all(claim["reason"].startswith(SENTENCE) for claim in claims)
    claims = project.json("--claims-stored")["claims"]
    assert [claim["outcome"] for claim in claims] == ["supported", "refuted"]
