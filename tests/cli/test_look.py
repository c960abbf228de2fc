"""`evoclaims look`: what it draws of tasks and champions, and what it says when it cannot."""

from __future__ import annotations

import io
import json
import math
import re
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest
import tiny_project
from tiny_project import FILES, Evoclaims, Project

from evoclaims.cli.project import open_project
from evoclaims.cli.stored_trial import load, run_again
from evoclaims.core.canonical import content_hash
from evoclaims.core.drawing import optional
from evoclaims.envs.ecorobot import physics
from evoclaims.envs.ecorobot.physics import Body
from evoclaims.envs.ecorobot.scene import Places, Scene
from evoclaims.trials.store import Store

# What the command imports late: pytester forgets the modules that a test has imported, and would load them twice.
for _module in ("backends.backend_agg", "backends.backend_svg", "collections", "figure", "lines", "patches", "path"):
    optional(f"matplotlib.{_module}")
for _module in ("Image", "GifImagePlugin", "PngImagePlugin"):
    optional(f"PIL.{_module}")
for _module in ("cli.champion", "cli.look", "envs.ecorobot.locomotion", "methods.random_search"):
    optional(f"evoclaims.{_module}")

MORE = """
from evoclaims.envs.ecorobot.locomotion import Obstacles
from evoclaims.envs.ecorobot.stones import SteppingStones
from evoclaims.methods.random_search import RandomSearch
from evoclaims.networks.mlp import Mlp

MAZE = SteppingStones(episode_steps=5, examined_episodes=3)
RANDOM = RandomSearch(population=2, network=Mlp((2,)))
BUDGET = Budget(generations=1, reports=1)
ROBOTS = {
    ("random", "maze"): Condition(RANDOM, MAZE, "whole_budget", BUDGET),
    ("random", "course"): Condition(RANDOM, Obstacles(episode_steps=2), "whole_budget", BUDGET),
}
REPRODUCTION = replace(REPRODUCTION, tiers={
    "smoke": Tier({**conditions(1), **ROBOTS}, Design.fixed(10)),
    "full": Tier(conditions(2), Design.fixed(10)),
})
"""


@pytest.fixture(scope="module", autouse=True)
def _gliding() -> Iterator[None]:
    """Let robots go where their actions point: pictures are looked at here, and not physics."""

    def glide(scene: Scene, body: Body, control: jax.Array, places: Places) -> Body:
        return replace(body, position=body.position.at[:2].add(0.1 * control[:2]))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(physics, "act", glide)
        yield


@pytest.fixture(autouse=True)
def _robots(project: Project) -> None:
    """The project has tasks with robots."""
    project.pytester.makepyfile(tiny_paper=tiny_project.REPRODUCTION + MORE)


@pytest.fixture
def trained(evoclaims: Evoclaims, kept: Path) -> Evoclaims:
    """A function that runs a command on a trial, of seed 4, on the maze."""
    if not (kept / "store").exists():
        assert evoclaims("run", "random", "--on=maze", "--trials=1", "--first-seed=4", "--device=cpu")[0] == 0
        shutil.copytree(".evoclaims", kept / "store")
    shutil.copytree(kept / "store", ".evoclaims", dirs_exist_ok=True)
    return evoclaims


def _texts(path: str) -> list[str]:
    return re.findall(r"<text[^>]*>([^<]*)</text>", Path(path).read_text())


def test_a_task_is_drawn_without_any_trial(evoclaims: Evoclaims) -> None:
    Path("none").mkdir()
    assert evoclaims("look", "maze", "--storage=none") == (0, "wrote figures/maze.svg\n", "")
    assert {"maze (smoke)", "1", "7", "simple_rob at the start, to scale"} <= set(_texts("figures/maze.svg"))
    assert not any(Path("none").iterdir())
    assert evoclaims("look", "course", "--out=a/b.PNG")[:2] == (0, "wrote a/b.PNG\n")
    assert Path("a/b.PNG").read_bytes().startswith(b"\x89PNG")


def test_the_paths_of_all_episodes_are_drawn(trained: Evoclaims) -> None:
    status, out, err = trained("look", "maze", "--method=random", "--seed=4", "--device=cpu")
    assert (status, err) == (0, "")
    lines = out.splitlines()
    assert lines[0] == "random on maze (smoke)"
    assert lines[1].startswith("  seed 4: done after ")
    assert lines[2:] == ["wrote figures/random-maze-4-path.svg"]
    texts = _texts("figures/random-maze-4-path.svg")
    assert "random on maze (smoke), seed 4" in texts
    assert "0 of 3 episodes reach the goal" in texts
    assert "paths of the torso in 3 episodes, and their ends" in texts


def test_the_episodes_are_those_by_which_the_trial_was_judged(trained: Evoclaims) -> None:
    trial = load(open_project(".evoclaims"), "smoke", "random", "maze", 4)
    task: Any = trial.condition.task
    outings = run_again(trial, task, jax.devices("cpu")[0])
    assert [len(path) for path in outings.torsos] == [len(steps) for steps in outings.positions] == [5, 5, 5]
    assert outings.reached == [False] * 3
    # What a step pays without a stone is 1 - (distance to the first) / (the arena's diagonal).
    away = np.linalg.norm(np.array(outings.torsos)[..., :2] - np.array([-1.0, 2.5]), axis=-1)
    fitness = (1.0 - away / math.hypot(8.0, 8.0)).sum(axis=1).mean()
    assert trial.result.levels["fitness"][0] == pytest.approx(fitness, rel=1e-5)
    assert len({tuple(path[-1]) for path in outings.torsos}) == 3


def test_an_episode_is_shown_up_to_its_end(trained: Evoclaims) -> None:
    trial = load(open_project(".evoclaims"), "smoke", "random", "maze", 4)
    task: Any = trial.condition.task
    # Every stone counts as crossed at once, one in a step: all seven after seven steps of nine.
    outings = run_again(trial, replace(task, within=20.0, episode_steps=9), jax.devices("cpu")[0])
    assert [len(path) for path in outings.torsos] == [len(steps) for steps in outings.positions] == [7, 7, 7]
    assert outings.reached == [True] * 3


def test_episodes_that_are_not_those_of_the_record_are_told(trained: Evoclaims) -> None:
    (path,) = (path for path in Store(Path(".evoclaims")).record_paths() if "random_search" in path.read_text())
    plain = json.loads(path.read_text())
    plain["levels"]["success"] = [0.75]
    plain["seal"] = content_hash({key: value for key, value in plain.items() if key != "seal"})
    path.write_text(json.dumps(plain))
    status, out, _ = trained("look", "maze", "--method=random", "--seed=4")
    assert (status, out.splitlines()[-1]) == (0, "wrote figures/random-maze-4-path.svg")
    assert "The share of episodes that reach the goal is 0 here, and 0.75 in the record" in out
    (command,) = re.findall("`evoclaims (.*)`", out)
    assert trained(*command.split())[0] == 1


def test_a_gif_has_a_frame_for_each_step(trained: Evoclaims) -> None:
    assert trained("look", "maze", "--method=random", "--seed=4", "--as=gif", "--episode=2")[0] == 0
    image = optional("PIL.Image").open(io.BytesIO(Path("figures/random-maze-4-gif.gif").read_bytes()))
    assert image.n_frames == 5


CHAMPION = ("maze", "--method=random", "--seed=4")


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("maz",), "There is no task named 'maz'. Did you mean 'maze'? Known: course, maze, parity."),
        (
            ("parity",),
            "parity has no robot and no ground, so there is nothing to look at. Tasks with one: course, maze.",
        ),
        (("parity", "--tier=full"), "there is nothing to look at. No task of this tier has one."),
        (("parity", "--method=right"), "parity has no robot and no ground"),
        (("maze", "--as=gif"), "--as gif shows what a champion does; name its method with --method."),
        (("maze", "--seed=0"), "--seed 0 shows what a champion does; name its method with --method."),
        (("maze", "--episode=3"), "--episode 3 shows what a champion does; name its method with --method."),
        (("maz", "--method=random"), "There is no task for random named 'maz'. Did you mean 'maze'?"),
        (
            ("maze", "--method=random", "--seed=77"),
            "holds no trial of random on maze (smoke) with seed 77, and no champion of it is committed. "
            "`evoclaims run random --on maze --tier smoke --trials 1 --first-seed 77` runs it, in about ",
        ),
        (
            (*CHAMPION, "--as=gfi"),
            "There is no way to look at a champion named 'gfi'. Did you mean 'gif'? Known: gif, path.",
        ),
        ((*CHAMPION, "--episode=3"), "The evaluation has 3 episodes, 0 to 2; --episode is 3."),
        (
            ("maze", "--out=maze.pdf"),
            "--out names a file that ends in .svg or .png, which selects its format; 'maze.pdf' does not.",
        ),
        ((*CHAMPION, "--as=gif", "--out=claims"), "--out names a file that ends in .gif, which selects its format"),
        (
            ("maze", "--out=tiny_paper.py/x.svg"),
            "Cannot write tiny_paper.py/x.svg: File exists. Name another file with --out.",
        ),
    ],
)
def test_a_users_mistake_is_one_sentence_and_status_2(
    trained: Evoclaims, arguments: tuple[str, ...], text: str
) -> None:
    status, _, err = trained("look", *arguments)
    assert (status, err.count("\n")) == (2, 1)
    assert err.startswith("evoclaims: ")
    assert text in err
    assert {path.name for path in Path().iterdir()} <= FILES


def test_a_folder_is_not_written_over(evoclaims: Evoclaims) -> None:
    Path("a.svg").mkdir()
    status, _, err = evoclaims("look", "maze", "--out=a.svg")
    assert (status, err) == (2, "evoclaims: a.svg is a folder; name a file in it with --out.\n")
