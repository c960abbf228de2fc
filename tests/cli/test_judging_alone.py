"""Judging from the command line: settings of other runs of pytest have no say, and every claim is spoken of."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

import pytest
from tiny_project import PYPROJECT, REPRODUCTION, Evoclaims, Project

from evoclaims.trials.store import Store

CLAIMS = {"a": "refuted", "b": "supported", "c": "supported"}
VERDICTS = "claims (smoke): 2 supported, 1 refuted"

OPTIONS = [
    "-x",
    "-k b -m full --deselect claims/test_claims.py::test_a --claims-only=b --claims-trials=2 --claims-json=out.json",
    "-m 'not claim' --maxfail=1 -n 2 --ignore=claims --lf --claims-variant=traded",
    "--collect-only",
    "--setup-only --strict-markers --strict-config -q -rA --tb=short",
]
"""Each of one line's leaves claims out, changes a verdict or writes a file where it is heeded."""


@pytest.fixture(autouse=True)
def _three_claims(evoclaims: Evoclaims, project: Project, stored: Store) -> None:
    """The project has three claims, of which the first is refuted, and their trials."""
    project.write(**CLAIMS)


def _set(addopts: str) -> None:
    Path("pyproject.toml").write_text(PYPROJECT.replace('addopts = "', f'addopts = "{addopts} '))


def test_options_for_other_runs_leave_no_claim_out(evoclaims: Evoclaims) -> None:
    for options in OPTIONS:
        _set(options)
        status, out, _ = evoclaims("status")
        assert (status, out.splitlines()[-1]) == (1, VERDICTS), options
        assert not Path("out.json").exists()


@pytest.mark.parametrize("name", ["a [b] c::d", "$HOME"])
def test_a_project_lies_in_a_folder_of_any_name(
    evoclaims: Evoclaims, project: Project, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    shutil.copytree(project.path, project.path / name, ignore=lambda folder, names: {name})
    for folder in (name, "claims"):  # a command is called anywhere in a project
        monkeypatch.chdir(folder)
        assert evoclaims("status")[1].splitlines()[-1] == VERDICTS


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("PYTEST_ADDOPTS", "-x -p picky -n 2"),
        ("PYTEST_ADDOPTS", "--nonsense"),
        ("PYTEST_PLUGINS", "picky"),
        ("PYTEST_PLUGINS", "nope"),
        ("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1"),
        ("pytest.ini", "-x -n 2 --nonsense"),
    ],
)
def test_what_the_environment_or_another_file_sets_changes_nothing_and_stays(
    evoclaims: Evoclaims, monkeypatch: pytest.MonkeyPatch, name: str, value: str
) -> None:
    Path("picky.py").write_text("def pytest_collection_modifyitems(items):\n    items.clear()\n")
    if name == "pytest.ini":
        Path(name).write_text(f"[pytest]\naddopts = {value}\n")
    else:
        monkeypatch.setenv(name, value)
    before = {one: value for one, value in os.environ.items() if one not in ("PYTEST_CURRENT_TEST", "PYTEST_VERSION")}
    status, out, _ = evoclaims("status")
    assert (status, out.splitlines()[-1]) == (1, VERDICTS)
    assert before.items() <= os.environ.items()


def test_how_files_are_imported_and_plugins_with_fixtures_are_kept(project: Project, evoclaims: Evoclaims) -> None:
    """Two files of one name can only be imported with importlib."""
    (project.path / "giving.py").write_text("import pytest\n\n@pytest.fixture\ndef method():\n    return 'right'\n")
    text = (
        "@says('d')\ndef test_d(trials, verdict, method):\n    verdict(trials(method, on='parity').mean_success > 0)\n"
    )
    project.write(text)
    more = project.path / "claims" / "more"
    more.mkdir()
    (more / "test_claims.py").write_text((project.path / "claims" / "test_claims.py").read_text().replace("'d'", "'e'"))
    _set("-x -p giving --import-mode=importlib")
    _, out, err = evoclaims("status")
    assert err == ""
    assert out.splitlines()[-1].startswith("claims (smoke): 2 ")


def test_a_plugin_that_the_project_requires_is_not_missed(evoclaims: Evoclaims) -> None:
    with Path("pyproject.toml").open("a") as file:
        file.write('\nrequired_plugins = ["pytest-xdist"]\n')
    status, out, _ = evoclaims("status")
    assert (status, out.splitlines()[-1]) == (1, VERDICTS)


@pytest.mark.parametrize(
    "hook",
    [
        "def pytest_collection_modifyitems(items):\n    items[:] = [one for one in items if 'b' not in one.name]\n",
        "import pytest\n\n@pytest.hookimpl(tryfirst=True)\ndef pytest_collection_modifyitems(items):\n"
        "    del items[2:]\n",
        "import pytest\ndef pytest_runtest_setup(item):\n    'b' in item.name and pytest.exit('enough')\n",
        "def pytest_runtest_setup(item):\n    item.session.shouldstop = 'enough'\n",
    ],
)
def test_claims_that_something_leaves_out_are_an_error_and_not_forgotten(evoclaims: Evoclaims, hook: str) -> None:
    Path("conftest.py").write_text(hook)
    status, _, err = evoclaims("accept", "--tier=smoke")
    assert (status, err.count("\n")) == (2, 1)
    unjudged = " of 3 claims of the smoke tier were collected and not judged (claims/test_claims.py::test_"
    assert unjudged in err or "taken claims out of the run without a word: claims/test_claims.py::test_b" in err
    assert not Path("verdicts.toml").exists()


def test_claims_in_a_file_that_is_not_collected_are_missed_in_a_sentence(evoclaims: Evoclaims) -> None:
    Path("claims/test_claims.py").rename("claims/hill.py")
    status, out, err = evoclaims("status")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert f"No claim found in {Path('claims').resolve()}: claims are in files test_*.py or *_test.py, on fun" in err
    assert "on functions test*, each with @claim(...)." in err
    Path("pyproject.toml").write_text(PYPROJECT + 'python_files = "hill*.py"\n')
    assert f"claims (smoke): {VERDICTS.split(': ')[1]}" in evoclaims("status")[1]


def test_an_interrupt_while_claims_are_judged_ends_the_command(evoclaims: Evoclaims) -> None:
    Path("conftest.py").write_text("def pytest_runtest_setup(item):\n    raise KeyboardInterrupt\n")
    assert evoclaims("accept")[0] == 130
    assert not Path("verdicts.toml").exists()


DURING_THE_CALL = """
STATE = {"limit": 0.0}

@says("d")
def test_d(trials, verdict, monkeypatch):
    monkeypatch.setitem(STATE, "limit", 2.0)
    verdict(trials("right", on="parity").event("e", lambda t: t.metrics["mean_success"] > STATE["limit"]).stays())

@says("e")
def test_e(trials, verdict):
    right = trials("right", on="parity")
    assert len(right.fetch(range(10))) == 10
    verdict(right.event("e", lambda t: pytest.skip("later")).stays())

@says("f")
def test_f(trials, verdict):
    verdict(trials("right", on="parity").solves_every_level.in_most_trials())
    assert verdict.report.n == 10
"""


def test_commands_judge_a_claim_during_its_call_as_pytest_does(project: Project, evoclaims: Evoclaims) -> None:
    """What its fixtures have set is there, its trials can be looked at, and a part of it may skip it."""
    sys.modules.pop("tiny_paper", None)
    project.pytester.makepyfile(tiny_paper=REPRODUCTION.replace("conditions(2), Design", "conditions(1), Design"))
    project.write(DURING_THE_CALL)
    status, out, _ = evoclaims("status")
    assert (status, out.splitlines()[-1]) == (1, "claims (smoke): 1 supported, 1 refuted, 1 not run")
    accepted = evoclaims("accept")[1].splitlines()  # of all tiers in one run
    assert [f"accepted: d ({tier}): refuted, the first verdict" in accepted for tier in ("smoke", "full")] == [True] * 2
    judged = project.json()
    assert [one["outcome"] for one in judged["claims"]] == ["refuted", "not run", "supported"]


IN_A_CLASS = """
class TestThem:
    seen = ()

    @says("d")
    def test_d(self, trials, verdict):
        assert not self.seen  # by the same test under another design
        self.seen += ("this one",)
        verdict(trials("right", on="parity").solves_every_level.in_most_trials())
"""


def test_claims_are_collected_once_for_all_that_a_command_judges(evoclaims: Evoclaims, project: Project) -> None:
    """Two tiers, two stores, and a variant of the protocol, whose trials are those of the wrong network."""
    project.write(IN_A_CLASS)
    log = Path("collected.log")
    Path("conftest.py").write_text(
        "def pytest_collection_finish(session):\n"
        f"    with open({log.name!r}, 'a') as log:\n        log.write('collected ')\n"
    )
    for command, said in (
        (("accept",), "accepted: d (smoke): supported, the first verdict"),
        (("report",), "claims (full): 1 not run\nclaims (smoke): 1 supported"),
        (("run", "right", "--variant=traded"), "d: supported -> refuted"),
        (("compare", "./.evoclaims", "./.evoclaims"), "verdicts: 1 the same, 1 not run, then or now"),
    ):
        log.unlink(missing_ok=True)
        assert said in evoclaims(*command)[1]
        assert log.read_text() == "collected "


CALLS = """
from pathlib import Path

def judge(tier, trials, verdict):
    with Path("called.log").open("a") as log:
        log.write(f"{tier} ")
    verdict(trials("right", on="parity").measure("success", lambda trial: print("read") or READ) > 0)

@claim("d", says="d at full size", where="§1")
def test_d(trials, verdict):
    judge("full", trials, verdict)

@claim.smoke("d", says="d in small")
def test_small_d(trials, verdict):
    judge("smoke", trials, verdict)

@says("e")
def test_e(trials, verdict):
    verdict(trials("wrong", on="parity").solves_every_level.in_most_trials())
"""


def test_a_test_is_called_once_for_all_that_judges_the_same(evoclaims: Evoclaims, project: Project) -> None:
    """A second store, and a variant that changes one of its conditions, call it again; the paper's numbers do not."""
    project.write(CALLS.replace("READ", "trial.metrics['last_success']"))
    log = Path("called.log")
    for command, calls in (
        (("status", "--as=json"), "smoke "),
        (("compare", "./.evoclaims", "./.evoclaims", "--tier=smoke"), "smoke smoke "),
        (("audit", "--tier=smoke"), "smoke "),
        (("report",), "smoke full smoke "),  # with the variant, whose trials are stored
        (("power",), "smoke "),
        (("status", "--variant=traded"), "smoke smoke "),
    ):
        log.unlink(missing_ok=True)
        _, out, _ = evoclaims(*command)
        assert log.read_text() == calls, command
        assert "read" not in out.split()


def test_what_a_measure_raises_is_the_error_of_its_claim(evoclaims: Evoclaims, project: Project) -> None:
    project.write(CALLS.replace("READ", "[][trial.seed]"))
    status, out, _ = evoclaims("status")
    assert (status, out.splitlines()[-1]) == (1, "claims (smoke): 1 refuted, 1 error")
    assert "IndexError: list index out of range (claims/test_claims.py, line " in out
    warns = "__import__('warnings').warn('odd number') or 1"
    project.write(CALLS.replace("READ", warns))
    assert "UserWarning: odd number (claims/test_claims.py, line " in evoclaims("status")[1]  # the project's settings
    ignoring = "@pytest.mark.filterwarnings('ignore:odd')\n@claim.smoke"
    project.write(CALLS.replace("READ", warns).replace("@claim.smoke", ignoring))
    assert evoclaims("status")[1].splitlines()[-1] == "claims (smoke): 1 supported, 1 refuted"
