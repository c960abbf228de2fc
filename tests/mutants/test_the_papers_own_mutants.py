"""The paper's own planted faults change what they say, each in conditions of its own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from evoclaims.core.errors import UserError
from evoclaims.envs.base import Numbered
from evoclaims.envs.ecorobot.locomotion import Obstacles
from evoclaims.envs.ecorobot.pose import Pose
from evoclaims.envs.ecorobot.stones import SteppingStones, StonesCrossed
from evoclaims.mutants import mutant
from evoclaims.mutants.mutant import MUTANTS, plantings
from reproductions.nisioti2025 import REPRODUCTION
from reproductions.nisioti2025.mutants import MUTANTS as OWN

SMOKE = REPRODUCTION.tiers["smoke"].conditions
STONES: Any = SMOKE["neat", "stones"].task
EVERY = {one.name: one for one in plantings(SMOKE, mutant.load(REPRODUCTION))}

PLANTED_AT_FIRST = {
    "cma_es: minimizes",
    "map_elites: random-archive",
    "stones: stones-pay-nothing",
    "n_parity: ignores-an-input",
    "stones: blind",
    "ppo: learning-rate-0",
}
"""One for each fault that went unnoticed when there were no mutants yet."""


def faulty(name: str, method: str, task: str) -> Any:
    return EVERY[name].conditions[method, task]


def test_there_are_many_faults_and_every_one_has_conditions_of_its_own() -> None:
    assert len(MUTANTS) + len(OWN) >= 20
    assert {one.mutant for one in EVERY.values()} == {*MUTANTS, *OWN}
    assert EVERY.keys() >= PLANTED_AT_FIRST
    ids = [condition.id for one in EVERY.values() for condition in one.conditions.values()]
    assert len({*ids, *(condition.id for condition in SMOKE.values())}) == len(ids) + len(SMOKE)


def test_a_faulty_component_can_be_copied_as_a_sound_one() -> None:
    """Null agents do so, and an error of theirs would hide what a claim says of the fault."""
    for one in EVERY.values():
        for condition in one.conditions.values():
            assert replace(condition.task) == condition.task
            assert replace(condition.method) == condition.method


def test_controls_have_faults_that_change_what_they_are() -> None:
    learnt = EVERY["random_policy: baseline-has-learnt"].conditions
    assert learnt["random_policy", "stones"].method == SMOKE["neat", "stones"].method
    assert learnt["random_policy", "locomotion_half_cheetah"].method == SMOKE["ppo", "locomotion_half_cheetah"].method
    rows = jnp.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    for name in ("hand_built", "hand_built_negated"):
        sound = SMOKE[name, "n_parity"]
        opposite = faulty(f"{name}: answers-the-opposite", name, "n_parity")
        answers = [jax.vmap(condition.method.best(condition.task, 0))(rows) > 0 for condition in (sound, opposite)]
        np.testing.assert_array_equal(answers[0], ~answers[1])
    assert faulty("waypoints: stands-still", "waypoints", "stones").method.speed == 0.0


def at(place: tuple[float, float]) -> Pose:
    return Pose(place=jnp.array([*place, 0.0]), rotation=jnp.eye(3))


def ruled(task: Any, crossed: int, place: tuple[float, float]) -> tuple[float, int, bool]:
    """Return the reward, the stones and the end of a step to a place."""
    ruling = task.rule(StonesCrossed(crossed=jnp.int32(crossed)), at(place), at(place), jnp.zeros(2))
    return float(ruling.reward), int(ruling.memory.crossed), bool(ruling.ended)


def test_stones_that_pay_nothing_are_counted_all_the_same() -> None:
    sound, task = STONES, faulty("stones: stones-pay-nothing", "neat", "stones").task
    second, last = len(sound.stones) - 2, len(sound.stones) - 1
    reward, crossed, ended = ruled(sound, second, sound.stones[second])
    assert ruled(task, second, sound.stones[second]) == (pytest.approx(reward - crossed, abs=1e-6), crossed, ended)
    assert crossed == second + 1
    assert ruled(sound, last, sound.stones[last])[0] > 1_000
    assert ruled(task, last, sound.stones[last]) == (1.0, last + 1, True)


def test_uncounted_stones_stay_uncounted() -> None:
    task = faulty("stones: stones-uncounted", "neat", "stones").task
    assert ruled(task, 1, STONES.stones[1])[1] == 1


def test_stones_from_afar_are_counted_from_afar() -> None:
    task = faulty("stones: stones-from-afar", "neat", "stones").task
    (x, y) = STONES.stones[0]
    assert [ruled(one, 0, (x + 0.9, y))[1] for one in (STONES, task)] == [0, 1]


@pytest.mark.parametrize(("name", "task"), [("no-walls", "stones"), ("no-walls", "deceptive_maze_easy")])
def test_walls_lie_under_the_floor_and_reachable_ground_stays(name: str, task: str) -> None:
    found = faulty(f"{task}: {name}", "ppo", task).task
    assert {box.top < 0 for box in found.boxes} == {True}
    assert isinstance(found, Numbered)
    np.testing.assert_array_equal(found.reachable(), SMOKE["ppo", task].task.reachable())  # type: ignore[attr-defined]
    assert np.max(np.asarray(found.numbers["geom_pos"])[:, 2]) < -2


def test_unseeing_rays_read_one() -> None:
    task = faulty("stones: unseeing-rays", "neat", "stones").task
    np.testing.assert_array_equal(task.sensor.read(None, None), np.ones(5))
    assert STONES.sensor != task.sensor
    assert task.observation_size == SteppingStones().observation_size


def test_flat_obstacles_do_not_rise() -> None:
    task = faulty("obstacles: flat-obstacles", "neat", "obstacles").task
    assert {box.top for box in task.boxes} == {0.0}
    assert {box.top for box in Obstacles().boxes} == {0.1, 0.2, 0.3}


def test_a_target_from_afar_is_reached_before_the_wall() -> None:
    task = faulty("deceptive_maze_easy: target-from-afar", "ppo", "deceptive_maze_easy").task
    before_the_wall = at((-1.0, 1.5))
    for maze, reached in ((task, True), (SMOKE["ppo", "deceptive_maze_easy"].task, False)):
        ruling = maze.rule(maze.memory(at((-1.0, 0.5))), before_the_wall, before_the_wall, jnp.zeros(2))  # type: ignore[attr-defined]
        assert bool(ruling.memory.done) == reached


def test_methods_have_the_parameters_that_their_faults_say() -> None:
    assert faulty("ppo: learning-rate-0", "ppo", "stones").method.learning_rate == 0
    growing = faulty("neat: grows-nothing", "neat", "stones").method.settings.mutation
    assert (growing.node_add, growing.connection_add, growing.weight.mutate_rate) == (0, 0, 0.1)
    keeping = faulty("hyperneat: keeps-values", "hyperneat", "stones").method.settings.mutation
    assert (keeping.weight.mutate_rate, keeping.bias.replace_rate, keeping.node_add) == (0, 0, 0.2)
    point = faulty("hyperneat: substrate-in-a-point", "hyperneat", "stones").method.substrate
    assert {place for layer in point.layers for place in layer} == {(0.0, 0.0)}
    assert point.shapes == SMOKE["hyperneat", "stones"].method.substrate.shapes  # type: ignore[attr-defined]
    assert ("hyperneat", "obstacles") not in EVERY["hyperneat: substrate-in-a-point"].conditions  # it has layers


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "has no MUTANTS"),
        ("MUTANTS = {'a': 1}", "has no MUTANTS"),
        ("1 / 0", "does not import: ZeroDivisionError"),
        (
            "from evoclaims.mutants import of_task, FaultyTask\nclass A(FaultyTask): says = 'a'\n"
            "MUTANTS = {'blind': of_task(A)}",
            "has a mutant called 'blind', as every paper has",
        ),
    ],
)
def test_a_module_without_mutants_is_one_sentence(
    text: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = f"mutants_of_{tmp_path.name}"
    (tmp_path / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(UserError, match=said):
        mutant.load(SimpleNamespace(name="tiny", folder=tmp_path, mutants=name))  # type: ignore[arg-type]
