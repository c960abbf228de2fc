"""Where a robot can get to, and how much of that a path has covered, against plain NumPy."""

from __future__ import annotations

from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from evoclaims.core.errors import UserError
from evoclaims.envs.ecorobot.boxes import Box
from evoclaims.envs.ecorobot.deceptive import DeceptiveMaze
from evoclaims.envs.ecorobot.maze import CELLS, FINE, MazePlan
from evoclaims.envs.ecorobot.robots import ANT
from evoclaims.envs.ecorobot.stones import STONES, SteppingStones

MAZES: dict[str, Any] = {
    "stones": SteppingStones(),
    "easy": DeceptiveMaze(),
    "difficult": DeceptiveMaze(difficulty="difficult"),
    "ant in the stones' maze": SteppingStones(robot=ANT),
}
STEPS = 24


def _flooded(task: Any, cells: tuple[int, int]) -> NDArray[np.bool_]:
    """Spread from the start, over all points at once, until nothing changes."""
    (low_x, high_x), (low_y, high_y) = task.area
    x, y = (
        low + (np.arange(count * FINE) + 0.5) * (high - low) / (count * FINE)
        for low, high, count in ((low_x, high_x, cells[0]), (low_y, high_y, cells[1]))
    )
    free = np.array([[_gap(task, a, b) >= task.robot.torso_radius for b in y] for a in x])
    been = np.zeros_like(free)
    been[np.abs(x - task.start[0]).argmin(), np.abs(y - task.start[1]).argmin()] = True
    while True:
        wider = np.pad(been, 1)
        wider = (wider[2:, 1:-1] | wider[:-2, 1:-1] | wider[1:-1, 2:] | wider[1:-1, :-2] | been) & free
        if (wider == been).all():
            return been.reshape(cells[0], FINE, cells[1], FINE).any(axis=(1, 3))
        been = wider


def _gap(task: Any, x: float, y: float) -> float:
    """Return how far a point is from the nearest wall: 0 inside one."""
    gaps = []
    for box in task.boxes:
        angle = np.radians(box.angle)
        dx, dy = x - box.centre[0], y - box.centre[1]
        along, across = dx * np.cos(angle) + dy * np.sin(angle), dy * np.cos(angle) - dx * np.sin(angle)
        gaps.append(np.hypot(max(abs(along) - box.half_size[0], 0.0), max(abs(across) - box.half_size[1], 0.0)))
    return float(min(gaps))


@cache
def _measure(name: str) -> Any:
    return jax.jit(lambda path, alive: MAZES[name].path_measures(path, alive)["coverage"])


def _coverage(name: str, path: list[tuple[float, float]]) -> float:
    """Return the coverage of a path that ends early: it goes on where it began, but no longer counts."""
    way = np.resize(np.array(path or [(0.5, 0.5)], np.float32), (STEPS, 2))
    return float(_measure(name)(jnp.asarray(way), jnp.arange(STEPS) < len(path)))


@pytest.mark.parametrize("name", MAZES)
def test_reachable_cells_are_those_that_a_flood_gets_to(name: str) -> None:
    task, cells = MAZES[name], (25, 20)
    np.testing.assert_array_equal(task.reachable(cells), _flooded(task, cells))


def test_every_stone_lies_in_a_reachable_cell_and_walls_do_not() -> None:
    ground = MAZES["stones"].reachable()
    assert ground.shape == CELLS
    for x, y in STONES:
        assert ground[int((x + 4) / 8 * 50), int(y / 7 * 50)]
    assert not ground[25, 0]  # the south wall
    assert not ground[int(1.5 / 8 * 50), int(4.91 / 7 * 50)]  # in the middle of wall 4, at 10°


@pytest.mark.parametrize("name", MAZES)
def test_going_to_the_middle_of_every_reachable_cell_covers_all(name: str) -> None:
    task = MAZES[name]
    low, high = np.array(task.area).T
    way = low + (np.argwhere(task.reachable()) + 0.5) / np.array(CELLS) * (high - low)
    everything, alive = jnp.asarray(way, jnp.float32), np.ones(len(way), bool)
    assert float(_measure(name)(everything, jnp.asarray(alive))) == 1.0
    alive[::2] = False
    assert float(_measure(name)(everything, jnp.asarray(alive))) == pytest.approx((len(way) // 2) / len(way))


places = st.lists(st.tuples(st.floats(-7.0, 7.0, width=32), st.floats(-1.0, 13.0, width=32)), max_size=STEPS)


@pytest.mark.parametrize("name", ["stones", "easy"])
@given(path=places)
@settings(max_examples=60, deadline=None)
def test_coverage_is_the_share_of_reachable_cells_and_never_falls_as_a_path_grows(
    name: str, path: list[tuple[float, float]]
) -> None:
    ground = MAZES[name].reachable()
    low, high = np.array(MAZES[name].area, np.float32).T
    cells = np.clip(np.floor((np.array(path, np.float32).reshape(-1, 2) - low) / (high - low) * 50), 0, 49).astype(int)
    last = 0.0
    for steps in range(len(path) + 1):
        been = {(x, y) for x, y in cells[:steps].tolist() if ground[x, y]}
        covered = _coverage(name, path[:steps])
        assert covered == pytest.approx(len(been) / ground.sum())
        assert last <= covered <= 1.0
        last = covered


class _Unfenced(DeceptiveMaze):
    """The easy maze's ground, with nothing around it."""

    @property
    def plan(self) -> MazePlan:
        return super().plan._replace(walls=())


def test_a_path_outside_the_area_covers_nothing() -> None:
    (low, high), (south, north) = _Unfenced().area
    inside = [(low + 0.01, (south + north) / 2)]
    outside = [(low - 5.0, y) for y in np.linspace(south, north, STEPS - 1)]
    measure = jax.jit(lambda path: _Unfenced().path_measures(path, jnp.ones(len(path), bool))["coverage"])
    assert 0.0 < float(measure(jnp.array(inside))) == float(measure(jnp.array([*inside, *outside])))
    assert float(measure(jnp.array([(high, north)]))) > 0.0


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"start": (-100.0, 0.0)}, r"has start=\(-100.0, 0.0\), outside its area or in a wall"),
        ({"walls": (Box((0.0, 0.0), (1.0, 1.0), angle=30.0),), "start": (0.9, 0.0)}, "outside its area or in a wall"),
        (
            {"target": (0.1, 0.0), "within": 0.1, "start": (0.0, 0.0), "walls": ()},
            "exactly within=0.1 of",
        ),
    ],
)
def test_a_plan_whose_start_is_no_place_to_start_is_one_sentence(changes: dict[str, Any], sentence: str) -> None:
    with pytest.raises(UserError, match=sentence):
        DeceptiveMaze().plan._replace(area=((-5.0, 5.0), (-5.0, 5.0)), **changes)
