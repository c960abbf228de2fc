"""`evoclaims report` in the tiny project: what it writes, prints and returns."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tiny_project import Evoclaims, Project

from evoclaims.cli.report import trajectory
from evoclaims.cli.stored_trial import Outings
from evoclaims.envs.ecorobot.stones import SteppingStones
from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.random_search import RandomSearch
from evoclaims.networks.mlp import Mlp
from evoclaims.report.champion import network
from evoclaims.report.model import Page
from evoclaims.trials.spec import Budget, Condition


@pytest.fixture(autouse=True)
def _three_claims(evoclaims: Evoclaims, project: Project) -> None:
    project.write(a="supported", b="refuted", c="error")


def test_both_files_are_written_and_named_with_the_totals(evoclaims: Evoclaims) -> None:
    assert evoclaims("run", "right")[0] == 0
    status, out, err = evoclaims("report")
    assert (status, err) == (0, "")
    assert out.splitlines() == [
        "wrote report/index.html",
        "wrote report/report.md",
        "claims (full): 3 not run",
        "claims (smoke): 1 supported, 2 not run",
    ]
    page = Path("report/index.html").read_text(encoding="utf-8")
    assert page.startswith("<!doctype html>")
    assert [f'id="{anchor}"' in page for anchor in ("a-full", "a-smoke")] == [True, True]
    assert "<blockquote>a at full size</blockquote>" in page
    assert "a in small" in page
    assert "### a (smoke): ✓ supported" in Path("report/report.md").read_text(encoding="utf-8")


def test_one_tier_alone_still_shows_the_papers_sentence(evoclaims: Evoclaims) -> None:
    status, out, _ = evoclaims("report", "--tier", "smoke", "--out", "there/deep")
    assert status == 0
    assert out.splitlines()[-1] == "claims (smoke): 3 not run"
    page = Path("there/deep/index.html").read_text(encoding="utf-8")
    assert 'id="a-smoke"' in page
    assert 'id="a-full"' not in page
    assert "<blockquote>a at full size</blockquote>" in page


def test_an_empty_store_without_references_makes_a_page_that_says_so(evoclaims: Evoclaims) -> None:
    assert evoclaims("report")[0] == 0
    for name in ("index.html", "report.md"):
        assert "No claim has been judged: neither the store nor the committed reference trials hold" in Path(
            "report", name
        ).read_text(encoding="utf-8")


def test_the_accepted_verdicts_are_read(evoclaims: Evoclaims) -> None:
    Path("verdicts.toml").write_text("schema = 99\n")
    status, _, err = evoclaims("report")
    assert status == 2
    assert "its schema is 99" in err


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("--tier", "fulll"), "There is no tier named 'fulll'. Did you mean 'full'? Known: all, full, smoke."),
        (("--out", "pyproject.toml"), "Cannot write pyproject.toml/index.html: "),
        (("--storage", "pyproject.toml"), "is a file, not a folder"),
    ],
)
def test_a_mistake_is_a_sentence(evoclaims: Evoclaims, arguments: tuple[str, ...], text: str) -> None:
    status, _, err = evoclaims("report", *arguments)
    assert status == 2
    assert text in " ".join(err.split())


def test_trajectories_are_drawn_of_robots_tasks_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    task = SteppingStones(episode_steps=5, examined_episodes=2)
    method = RandomSearch(population=2, network=Mlp((2,)))
    condition = Condition(method, task, "whole_budget", Budget(generations=1, reports=1))
    ways = [np.array([[0.0, 0.0, 0.1], [1.0, 2.0, 0.1]], np.float32)] * 2
    asked: list[Any] = []

    def run_again(trial: Any, task: Any, device: Any) -> Outings:
        asked.append((trial.parameters, task))
        return Outings(positions=ways, torsos=ways, reached=[False, False])

    monkeypatch.setattr("evoclaims.cli.report.run_again", run_again)
    result: Any = object()
    drawn = trajectory(condition, result, "parameters", "a <title>")
    assert drawn is not None
    assert b"a &lt;title&gt;" in drawn
    assert asked == [("parameters", task)]
    assert trajectory(replace(condition, task=NParity(3)), result, "parameters", "title") is None


def test_trajectories_come_before_networks_when_they_are_asked_for(
    evoclaims: Evoclaims, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Any] = []
    monkeypatch.setattr("evoclaims.cli.report.gather", lambda *_, draws, **__: seen.append(draws) or Page("", "", ()))
    assert evoclaims("report")[0] == evoclaims("report", "--trajectories")[0] == 0
    assert seen == [(network,), (trajectory, network)]
