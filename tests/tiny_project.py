"""A tiny project with claims of every end, judged by real trials that compile in no time."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from evoclaims import cli
from evoclaims.trials.result import TrialResult, digest
from evoclaims.trials.store import Store

FILES = {".evoclaims", "pyproject.toml", "tiny_paper.py", "claims", "__pycache__"}
"""What is in the project's folder when a command has written nothing else."""

PYPROJECT = """
[tool.evoclaims]
reproduction = "tiny_paper"

[tool.pytest.ini_options]
testpaths = ["claims"]
addopts = "--strict-markers --strict-config -p no:anyio -p no:benchmark -p no:hypothesispytest -p no:jaxtyping"
filterwarnings = ["error"]
"""
"""Without other installed plugins, which a sixth of a run is for."""

REPRODUCTION = '''
"""Hand-built networks that are right, wrong, or either by the toss of a coin."""
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import jax
import jax.numpy as jnp

from evoclaims.envs.gates.parity import NParity
from evoclaims.judging.design import Design
from evoclaims.methods.base import Policy, Progress
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.paper.reproduction import Reproduction, Tier
from evoclaims.paper.reproduction import Variant, changed
from evoclaims.trials.spec import Budget
from evoclaims.trials.spec import Condition


@dataclass(frozen=True)
class Coin:
    """A network that is right on about half of the seeds."""

    name: ClassVar[str] = "coin"
    revision: ClassVar[int] = 1

    def init(self, key, task):
        return jnp.where(jax.random.bernoulli(key), 1.0, -1.0)

    def step(self, key, task, level, state):
        episode = task.examine(self.best(task, state), key, level)
        return state, Progress(episode.fitness, episode.success, jnp.ones((), bool), {})

    def best(self, task, state):
        right = HandBuilt().best(task, jnp.int32(0))
        return Policy(state, lambda sign, bits: sign * right(bits))

    def cost(self, task):
        return task.horizon


class Broken(Coin):
    name: ClassVar[str] = "broken"

    def init(self, key, task):
        raise RuntimeError("out of order")


METHODS = {"right": HandBuilt(), "wrong": HandBuilt(negated=True), "coin": Coin(), "broken": Broken()}


def conditions(generations):
    budget = Budget(generations=generations, reports=1)
    return {(name, "parity"): Condition(m, NParity(2), "curriculum", budget) for name, m in METHODS.items()}


def traded(method, task, condition):
    """`right` becomes what `wrong` is; nothing else changes."""
    return replace(condition, method=METHODS["wrong"]) if method == "right" else None


def traded_in(generations):
    return changed(conditions(generations), traded)


REPRODUCTION = Reproduction(
    name="tiny",
    title="A Tiny Paper",
    folder=Path(__file__).parent,
    tiers={"smoke": Tier(conditions(1), Design.fixed(10)), "full": Tier(conditions(2), Design.fixed(10))},
    variants={"traded": Variant("The right network is wrong", {"smoke": traded_in(1), "full": traded_in(2)})},
)
'''

HEAD = """
import pytest
from evoclaims import Outcome, claim, expected

def says(name, **kwargs):
    return claim(name, says=f"{name} at full size", where="§1", smoke=f"{name} in small", **kwargs)
"""

BODIES = {
    "supported": "verdict(trials('right', on='parity').solves_every_level.in_most_trials())",
    "refuted": "verdict(trials('wrong', on='parity').solves_every_level.in_most_trials())",
    "undecided": "verdict(trials('coin', on='parity').solves_every_level.in_most_trials(p0=0.5))",
    "error": "verdict(trials('broken', on='parity').solves_every_level.in_most_trials())",
}


def claims(**bodies: str) -> str:
    """Return a module with one claim for each name, whose test has this body (a key of BODIES, or code)."""
    tests = [
        f"@says('{name}')\ndef test_{name}(trials, verdict):\n    {BODIES.get(body, body)}\n"
        for name, body in bodies.items()
    ]
    return HEAD + "\n\n" + "\n\n".join(tests)


@pytest.fixture(scope="session")
def trials_of_both(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with the smoke tier's trials of the right and the wrong network, run once; tests copy it."""
    from evoclaims.envs.gates.parity import NParity
    from evoclaims.methods.hand_built import HandBuilt
    from evoclaims.trials import devices
    from evoclaims.trials.runner import run
    from evoclaims.trials.spec import Budget, Condition

    store = Store(tmp_path_factory.mktemp("both") / "store")
    store.check_writable()
    for method in (HandBuilt(), HandBuilt(negated=True)):
        condition = Condition(method, NParity(2), "curriculum", Budget(generations=1, reports=1))
        run(condition, range(10), store, devices.choose("cpu"))
    return store.root


@pytest.fixture(scope="session")
def shared_store(tmp_path_factory: pytest.TempPathFactory, trials_of_both: Path) -> Path:
    """A store that tests share which do not look into it, so that their trials are run once."""
    return shutil.copytree(trials_of_both, tmp_path_factory.mktemp("shared") / "store")


class Project:
    """The tiny project in pytester's folder."""

    def __init__(self, pytester: pytest.Pytester, store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("COLUMNS", "160")  # so that no line of interest is wrapped
        monkeypatch.delenv("GITHUB_STEP_SUMMARY", raising=False)  # these verdicts are for no page
        monkeypatch.setattr(sys, "dont_write_bytecode", True)  # two edits of one length in one second would share it
        self.pytester = pytester
        self.path = pytester.path
        self.store = store
        pytester.makepyprojecttoml(PYPROJECT)
        pytester.makepyfile(tiny_paper=REPRODUCTION)
        (self.path / "claims").mkdir()

    def write(self, text: str = "", **bodies: str) -> None:
        """Write the claims; see `claims`. Those that this process may have read before are forgotten."""
        sys.modules.pop("test_claims", None)
        (self.path / "claims" / "test_claims.py").write_text((text and HEAD + text) or claims(**bodies))

    def run(self, *arguments: str, own_store: bool = False) -> pytest.RunResult:
        """Run pytest in this process; on the shared store unless told otherwise."""
        storage = () if own_store else (f"--claims-storage={self.store}",)
        return self.pytester.runpytest_inprocess(*storage, *arguments)

    def run_apart(self, *arguments: str) -> pytest.RunResult:
        """Run pytest in a process of its own, on the project's own store."""
        return self.pytester.runpytest_subprocess(*arguments)

    def json(self, *arguments: str) -> dict[str, Any]:
        """Run, and return what --claims-json wrote."""
        self.run("--claims-json=out.json", *arguments)
        plain: dict[str, Any] = json.loads((self.path / "out.json").read_text())
        return plain


@pytest.fixture
def project(shared_store: Path, pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> Project:
    """The tiny project, without claims yet."""
    return Project(pytester, shared_store, monkeypatch)


@pytest.fixture
def stored(project: Project, trials_of_both: Path) -> Store:
    """The project's own store, with the trials of the right and the wrong network."""
    return Store(Path(shutil.copytree(trials_of_both, ".evoclaims")))


def trials_of(store: Store, method: str) -> list[TrialResult]:
    """Return a store's trials of a method, called as the package calls it."""
    return [trial for trial in store.results([]) if trial.spec["method"]["name"] == method]


def aged(trial: TrialResult) -> TrialResult:
    """Return a trial as numpy 1.0 might have made it."""
    versions = {**trial.provenance["versions"], "numpy": "1.0"}
    return replace(trial, provenance={**trial.provenance, "versions": versions}, champion="")


def spoiled(trial: TrialResult) -> TrialResult:
    """Return what a broken library might have made of a trial that went well."""
    levels = {name: (0.0,) * len(values) for name, values in trial.levels.items()}
    metrics = {**trial.metrics, "mean_success": 0.0}
    new = digest(trial.status, metrics, levels, trial.curves, b"")
    return replace(trial, metrics=metrics, levels=levels, digest=new, champion="")


def out_of_time(trial: TrialResult) -> TrialResult:
    """Return a trial as it is where its time did not suffice."""
    timing = {**trial.timing, "limit": 1.0}
    return replace(
        spoiled(trial),
        status="timeout",
        metrics={},
        levels={},
        timing=timing,
        digest=digest("timeout", {}, {}, trial.curves, b""),
    )


def forget(store: Store, trials: Iterable[TrialResult]) -> None:
    """Remove records from a store."""
    for trial in trials:
        for path in store.record_files(trial.id):
            path.unlink(missing_ok=True)


Evoclaims = Callable[..., tuple[int, str, str]]


@pytest.fixture
def evoclaims(project: Project, capsys: pytest.CaptureFixture[str]) -> Evoclaims:
    """A function that runs a command in the project, of a right claim `a` and a wrong one `b` unless a test says else.

    It returns status, output and errors, none of which is a traceback.
    """
    project.write(a="supported", b="refuted")

    def run(*arguments: str) -> tuple[int, str, str]:
        capsys.readouterr()
        status = cli.main(arguments)
        out, err = capsys.readouterr()
        assert "Traceback" not in out + err
        assert "INTERNALERROR" not in out + err
        return status, out, err

    return run


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder where the first test of a module keeps what it has made, for the others to copy."""
    return tmp_path_factory.mktemp("kept")


@pytest.fixture
def accepted(evoclaims: Evoclaims, stored: Store, kept: Path) -> Evoclaims:
    """The same, with trials in the project's store, and their verdicts of the smoke tier accepted."""
    if not (kept / "verdicts.toml").exists():
        assert evoclaims("accept", "--tier=smoke")[0] == 1
        shutil.copy("verdicts.toml", kept)
    shutil.copy(kept / "verdicts.toml", ".")
    return evoclaims


@pytest.fixture(scope="session")
def sentence() -> Callable[[pytest.RunResult, str], None]:
    """A function that checks that a run ended with a sentence and no traceback."""

    def check(result: pytest.RunResult, text: str) -> None:
        shown = "\n".join([*result.outlines, *result.errlines])
        assert text in " ".join(shown.split())
        assert "Traceback" not in shown
        assert "INTERNALERROR" not in shown

    return check
