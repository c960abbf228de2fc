"""A claim counts once, by its last run, whatever runs its test again; the other runs are in its evidence."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

CLAIMS = """
RUNS = []


@says('a')
def test_a(trials, verdict):
    verdict(trials('right', on='parity').solves_every_level.in_most_trials())


@says('b')
def test_b(trials, verdict):
    verdict(trials('wrong', on='parity').solves_every_level.in_most_trials())


@pytest.mark.parametrize('case', ['one', 'two'])
@says('c')
def test_c(request, case, trials, verdict):
    RUNS.append(case)
    if RUNS.count(case) < 2:
        raise OSError('no network')
    verdict(trials('right', on='parity').solves_every_level.in_most_trials())
"""

PROTOCOL = """
from _pytest.runner import runtestprotocol

def pytest_runtest_protocol(item, nextitem):
    for last in (False, True):
        for report in runtestprotocol(item, nextitem=nextitem, log=False):
            if report.failed and not last:
                report.outcome = 'rerun'
            item.ihook.pytest_runtest_logreport(report=report)
    return True

def pytest_report_teststatus(report):
    return ('rerun', 'R', 'RERUN') if report.outcome == 'rerun' else None
"""

PARAMETERS = """
import pytest

@pytest.fixture
def repetition(request):
    return request.param

@pytest.hookimpl(HOW)
def pytest_generate_tests(metafunc):
    metafunc.fixturenames.append('repetition')
    metafunc.parametrize('repetition', [7, pytest.param(8, id='again')], indirect=INDIRECT)
"""

ITEMS = """
import copy

def pytest_collection_modifyitems(items):
    items += [copy.copy(item) for item in items]
    for item in items:
        item._initrequest()
"""

UNREPORTED = """
import pytest

@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_makereport(item, call):
    report = yield
    if call.when == 'call' and report.failed:
        item.ihook.pytest_runtest_teardown(item=item, nextitem=None)
        item._initrequest()
        item.ihook.pytest_runtest_setup(item=item)
        item.ihook.pytest_runtest_call(item=item)
        report.outcome, report.longrepr = 'passed', None
    return report
"""

UNLOGGED = """
import pytest
from _pytest import runner

def pytest_runtest_protocol(item, nextitem):
    for _ in range(2):
        for report in runner.runtestprotocol(item, nextitem=nextitem, log=False):
            if not report.failed:
                item.ihook.pytest_runtest_logreport(report=report)
    return True
"""


@pytest.mark.parametrize(
    "plugin",
    [
        PROTOCOL,
        PARAMETERS.replace("HOW", "tryfirst=True").replace("INDIRECT", "False"),
        PARAMETERS.replace("HOW", "trylast=True").replace("INDIRECT", "True"),
        ITEMS,
        UNLOGGED,
    ],
    ids=["reruns", "parameters before", "parameters after", "copied items", "reports that nobody sees"],
)
def test_claim_run_twice_counts_once_by_its_last_run(project: Any, plugin: str) -> None:
    assert _runs(project, plugin) == {
        "a": ["supported", "supported"],
        "b": ["refuted", "refuted"],
        "c[one]": ["error", "supported"],
        "c[two]": ["error", "supported"],
    }


def test_claim_called_again_without_a_report_counts_by_that_call(project: Any) -> None:
    assert _runs(project, UNREPORTED) == {
        "a": ["supported"],
        "b": ["refuted", "refuted"],
        "c[one]": ["error", "supported"],
        "c[two]": ["error", "supported"],
    }


def _runs(project: Any, plugin: str) -> dict[str, list[str]]:
    """Return how each claim's runs ended, the one that counts last, after a check that all places agree."""
    project.write(CLAIMS)
    (project.path / "conftest.py").write_text(plugin)
    result = project.run("--claims-json=out.json")
    assert result.ret == 1  # b is refuted
    result.stdout.fnmatch_lines(
        ["*c[[]one[]] (smoke) ran 2 times, error -> supported: the last run counts", "claims: 3 supported, 1 refuted"]
    )
    claims = json.loads((project.path / "out.json").read_text())["claims"]
    for claim in claims:
        assert json.loads(Path(claim["evidence"]).read_text())["earlier"] == claim["earlier"]
    named = [claim["claim"] + (claim["case"] and f"[{claim['case']}]") for claim in claims]
    assert named == ["a", "b", "c[one]", "c[two]"]
    return {
        name: [run["outcome"] for run in [*claim["earlier"], claim]] for name, claim in zip(named, claims, strict=True)
    }


def test_repeated_claim_is_one_row_of_a_command(project: Any, capsys: pytest.CaptureFixture[str]) -> None:
    from evoclaims.cli import main

    project.write(a="supported", b="refuted")
    (project.path / "conftest.py").write_text(PARAMETERS.replace("HOW", "trylast=True").replace("INDIRECT", "True"))
    main(["status", "--tier=smoke", f"--storage={project.store}", "--as=csv"])
    assert [line.partition(",")[0] for line in capsys.readouterr().out.splitlines()[1:]] == ["a", "b"]


def test_claim_repeated_on_workers_is_counted_once(project: Any) -> None:
    project.write(a="supported", b="refuted")
    (project.path / "conftest.py").write_text(PARAMETERS.replace("HOW", "trylast=True").replace("INDIRECT", "True"))
    result = project.run("-n2", "--claims-json=out.json")
    assert result.ret == 1
    result.stdout.fnmatch_lines(["claims: 1 supported, 1 refuted"])
    claims = json.loads((project.path / "out.json").read_text())["claims"]
    assert [(claim["claim"], claim["outcome"]) for claim in claims] == [("a", "supported"), ("b", "refuted")]
