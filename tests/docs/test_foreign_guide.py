"""The training loops that the guide shows are made from the guide, word for word, and run."""

from __future__ import annotations

import json
import re
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import jax
import pytest

from evoclaims import cli
from evoclaims.envs.foreign.gymnasium_task import GymnasiumTask
from evoclaims.envs.foreign.gymnax_task import GymnaxTask
from evoclaims.methods.training_loop import TrainingLoop
from evoclaims.trials.result import TrialResult
from evoclaims.trials.runner import run
from evoclaims.trials.spec import Budget, Condition
from evoclaims.trials.store import Store

GUIDE = Path(__file__).parents[2] / "docs" / "foreign.md"
PROJECT = ("numpy_loops.py", "cart_paper.py", "claims/test_cart.py", "pyproject.toml")

PUREJAXRL = """
import jax, jax.numpy as jnp

def make_train(config):
    steps = int(config["TOTAL_TIMESTEPS"]) // config["NUM_ENVS"]
    assert config["ENV_NAME"] == "CartPole-v1"

    def train(rng):
        def update(state, key):
            state = state + config["LR"] * jax.random.normal(key, (config["NUM_ENVS"],))
            return state, {"returned_episode_returns": state}
        state, metrics = jax.lax.scan(update, jnp.zeros(config["NUM_ENVS"]), jax.random.split(rng, steps))
        return {"runner_state": state, "metrics": metrics}

    return train
"""
"""A training function of purejaxrl's shape, which is no package."""


def files() -> dict[str, str]:
    """Return the guide's files by name: each block follows a text that ends with its name in backquotes and a colon."""
    found = re.findall(r"`([\w/.]+)`:\n\n```\w+\n(.*?)```", GUIDE.read_text(encoding="utf-8"), flags=re.DOTALL)
    return dict(found)


def written(folder: Path, *names: str) -> None:
    """Write some of the guide's files."""
    for name in names:
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(files()[name], encoding="utf-8")


def needs(*packages: str) -> pytest.MarkDecorator:
    """Skip a test where a package is missing, and say which."""
    missing = [name for name in packages if find_spec(name) is None]
    return pytest.mark.skipif(bool(missing), reason=f"not installed: {', '.join(missing)}")


@pytest.fixture
def trained(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """A function that trains one of the guide's loops, with the seeds 0 and 1, and with 0 again."""
    monkeypatch.syspath_prepend(tmp_path)

    def train(place: str, task: Any, steps: int, **settings: Any) -> list[TrialResult]:
        written(tmp_path, f"{place.partition(':')[0]}.py")
        loop = TrainingLoop(place, settings, packages=())
        condition = Condition(loop, task, "whole_budget", Budget(environment_steps=steps, reports=4))
        first = run(condition, [0, 1], Store(tmp_path / "first"), jax.devices("cpu"))
        (again,) = run(condition, [0], Store(tmp_path / "again"), jax.devices("cpu"))
        assert [result.status for result in first] == ["done", "done"], first[0].provenance.get("crash")
        assert first[0].digest == again.digest != first[1].digest
        return first

    return train


def test_every_loop_is_short() -> None:
    assert {*PROJECT, "sb3_loops.py", "rejax_loops.py", "purejaxrl_loops.py"} == set(files())
    for name, text in files().items():
        assert sum(bool(line.strip()) for line in text.splitlines()) <= 30, name


@needs("gymnasium")
def test_a_project_with_a_training_loop_comes_to_a_verdict_and_all_commands_know_it(
    pytester: pytest.Pytester, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "160")
    written(pytester.path, *PROJECT)
    result = pytester.runpytest_inprocess("-m", "smoke", "--claims-json=out.json", "-p", "no:xdist")
    assert result.ret == 0
    claims = json.loads((pytester.path / "out.json").read_text())["claims"]
    assert [(claim["claim"], claim["outcome"]) for claim in claims] == [("H1", "supported")]
    monkeypatch.syspath_prepend(pytester.path)
    for command in ("plan", "plan --measure", "status", "run", "report", "verify"):
        assert cli.main(command.split()) == 0, command
    told = capsys.readouterr().out
    assert "hill_climbing on cart" in told
    assert "seed 9: done after 2," in told
    assert cli.main(["champion", "hill_climbing", "--on", "cart"]) == 2
    assert "'hill_climbing' is a training loop" in capsys.readouterr().err
    assert cli.main(["mutants"]) == 2  # instead of faults that change nothing, and a claim that is called insensitive
    assert "are imported, or come from training loops" in capsys.readouterr().err
    broken = "def hill_climbing(task, seed, budget, spread):\n    return 1 / seed\n"
    (pytester.path / "numpy_loops.py").write_text(broken)
    assert cli.main(["run", "--tier=full", "--trials=1"]) == 1
    told = capsys.readouterr().out
    assert "seed 0: crashed after 0 environment steps: ZeroDivisionError: division by zero" in told
    assert "what seed 0 printed last:\n" in told
    assert 'numpy_loops.py", line 2, in hill_climbing\n' in told


@needs("stable_baselines3")
@pytest.mark.slow
def test_stable_baselines_trains_on_gymnasium(trained: Any) -> None:
    cart = GymnasiumTask("CartPole-v1", examined_episodes=3)
    results = trained("sb3_loops:ppo", cart, 1500, n_steps=256)
    for result in results:
        assert result.metrics["last_fitness"] > 50
        assert result.metrics["environment_steps"] == 1536
        assert len(result.curves["fitness"]) == 5


@needs("rejax")
@pytest.mark.slow
def test_rejax_trains_on_gymnax(trained: Any) -> None:
    cart = GymnaxTask("CartPole-v1", {"max_steps_in_episode": 100}, episode_steps=100, examined_episodes=3)
    results = trained("rejax_loops:ppo", cart, 2048, num_envs=8, num_steps=32)
    for result in results:
        assert result.metrics["last_fitness"] > 15
        assert len(result.curves["fitness"]) == 5


def test_a_function_of_purejaxrl_s_shape_trains(trained: Any, tmp_path: Path) -> None:
    (tmp_path / "ppo.py").write_text(PUREJAXRL)
    results = trained("purejaxrl_loops:purejaxrl", GymnaxTask("CartPole-v1"), 64, LR=0.5, NUM_ENVS=4)
    assert all(result.metrics["last_fitness"] != 0 for result in results)
