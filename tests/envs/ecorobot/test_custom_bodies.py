"""What a custom robot is made of decides which trials are its own."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import pytest
from custom_robots import BASE, Texts

from evoclaims.core.canonical import as_plain, content_hash
from evoclaims.core.errors import UserError
from evoclaims.envs.ecorobot import model_files
from evoclaims.envs.ecorobot.boxes import Box
from evoclaims.envs.ecorobot.locomotion import Locomotion
from evoclaims.envs.ecorobot.robots import ROBOTS, Robot
from evoclaims.envs.ecorobot.scene import Scene
from evoclaims.methods.random_search import RandomSearch
from evoclaims.networks import Mlp
from evoclaims.trials.result import TrialResult
from evoclaims.trials.runner import warn_of_edited_bodies
from evoclaims.trials.spec import Budget, Condition


def _condition(robot: Robot) -> Condition:
    task = Locomotion(robot=robot, episode_steps=2)
    return Condition(
        RandomSearch(population=2, network=Mlp((2,))), task, "whole_budget", Budget(generations=1, reports=1)
    )


EDITS = {
    "a gain": ('gainprm="3"', 'gainprm="-3"'),
    "a density": ('size="0.1"', 'size="0.1" density="90000"'),
    "an option": ('timestep="0.01"', 'timestep="0.005"'),
    "a digit that float32 has": ('damping="0.3"', 'damping="0.3000001"'),
    "a name that a rule may look up": ('name="tip"', 'name="toe"'),
    "a contact bit": ('name="shin"', 'name="shin" contype="0"'),
    "the floor": ('size="9 9 1"', 'size="9 9 1" friction="0.1 0.1 0.1"'),
}


@pytest.mark.parametrize("edit", EDITS.values(), ids=EDITS)
def test_an_edited_robot_has_other_trials(edit: tuple[str, str], texts: Texts) -> None:
    before = _condition(texts.robot(BASE))
    after = _condition(texts.robot(BASE.replace(*edit)))
    assert before.id != after.id
    assert before.task != after.task  # or programs that are compiled once would be shared


@pytest.mark.parametrize(
    "edit",
    [
        ("<worldbody>", "<!-- a comment --><worldbody>"),
        ('name="shin"', 'name="shin" rgba="1 0 0 1"'),
        ("<worldbody>", '<worldbody><camera name="eye" pos="0 0 9"/><light pos="0 0 5"/>'),
        ('damping="0.3"', 'damping="0.30"'),
    ],
    ids=["a comment", "a colour", "a camera and a light", "a digit"],
)
def test_what_changes_no_motion_changes_no_trial(edit: tuple[str, str], texts: Texts) -> None:
    assert _condition(texts.robot(BASE)).id == _condition(texts.robot(BASE.replace(*edit))).id


def test_an_included_file_and_a_mesh_are_part_of_the_body(texts: Texts) -> None:
    whole = BASE.replace("<worldbody>", '<include file="more.xml"/><worldbody>', 1).replace(
        'type="sphere" size="0.1"', 'type="mesh" mesh="hull"'
    )
    more, mesh = texts.folder / "more.xml", texts.folder / "hull.obj"
    included = '<mujoco><asset><mesh name="hull" file="hull.obj"/></asset><option viscosity="{}"/></mujoco>'
    vertices = "v 0 0 {}\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 -0.1\nf 1 2 3\nf 1 3 4\nf 1 4 2\nf 2 4 3\n"

    def body(viscosity: float, height: float, at: int) -> str | None:
        more.write_text(included.format(viscosity))
        mesh.write_text(vertices.format(height))
        os.utime(mesh, (at, at))  # MuJoCo keeps meshes by the second of their file
        return texts.robot(whole).body

    bodies = [body(0.0, 0.1, 1), body(0.1, 0.1, 2), body(0.0, 0.11, 3)]
    assert len(set(bodies)) == 3
    assert body(0.0, 0.1, 4) == bodies[0]


def test_the_built_in_robots_have_no_body_in_their_ids() -> None:
    assert {robot.xml for robot in ROBOTS.values()} == set(model_files.BUILT_IN)
    for robot in ROBOTS.values():
        assert "body" not in as_plain(robot)
    assert content_hash(as_plain(ROBOTS["ant"])) == "695f820d7199e358f0dd1b964faece8243dd26680617dbe8d04cf2234c228d50"


def test_a_built_in_robot_s_file_that_was_edited_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    xml = ROBOTS["simple_rob"].xml
    monkeypatch.setitem(model_files.BUILT_IN, xml, "0" * 64)
    with pytest.raises(
        UserError, match=r"The model of the robot simple_rob, .*, is not the file with which the paper's trials"
    ):
        model_files.read("simple_rob", xml)


def test_an_edit_while_a_process_runs_is_refused(texts: Texts) -> None:
    robot = texts.robot(BASE)
    (texts.folder / "rover.xml").write_text(BASE.replace('gainprm="3"', 'gainprm="4"'))
    with pytest.raises(UserError, match="The model of the robot rover was edited while this process ran"):
        _ = Scene(robot, (Box((3.0, 3.0), (0.1, 0.1)),)).whole


@dataclass
class _Shelf:
    """A store of some results."""

    held: list[TrialResult]

    def results(self, errors: Any) -> list[TrialResult]:
        return self.held


def _trial(condition: Condition) -> TrialResult:
    spec = {**condition.plain, "seed": 0}
    return TrialResult("x", condition.id, spec, 0, "done", {}, {}, {}, "", {}, {})


def test_trials_of_the_old_body_are_named_when_they_run_again(texts: Texts, recwarn: pytest.WarningsRecorder) -> None:
    old = _condition(texts.robot(BASE))
    new = _condition(texts.robot(BASE.replace('gainprm="3"', 'gainprm="4"')))
    other = _condition(texts.robot(BASE, frames=3))
    shelf: Any = _Shelf([_trial(old), _trial(other)])
    with pytest.warns(
        UserWarning, match="The model of the robot rover was edited: 1 stored trials of random_search on loc"
    ):
        warn_of_edited_bodies(new, shelf)
    warn_of_edited_bodies(old, shelf)
    warn_of_edited_bodies(_condition(ROBOTS["half_cheetah"]), shelf)
    assert not recwarn.list
