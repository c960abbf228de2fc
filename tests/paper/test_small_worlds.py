"""The smoke tier's rooms: what they promise about ways, walls, stones and the ant's legs."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from evoclaims.envs.ecorobot.maze import CELLS, Maze
from evoclaims.envs.ecorobot.robots import ANT
from evoclaims.envs.ecorobot.scene import box_geoms, scene
from evoclaims.envs.ecorobot.views.motion import marks
from reproductions.nisioti2025.small_worlds import STONES, SmallDeceptiveMaze, ThreeStones

ROOMS: dict[str, Maze] = {
    "stones": ThreeStones(),
    "easy": SmallDeceptiveMaze(),
    "difficult": SmallDeceptiveMaze(difficulty="difficult"),
}


def _blocked(room: Maze, start: tuple[float, float], end: tuple[float, float]) -> bool:
    """Whether a wall lies on the straight way of the robot's body."""
    way = np.linspace(start, end, 200)
    return any(bool((box.distance(way) < room.robot.torso_radius).any()) for box in room.boxes)


@pytest.mark.parametrize("name", ROOMS)
def test_the_target_can_be_reached_but_not_straight_ahead(name: str) -> None:
    room = ROOMS[name]
    assert room.start is not None
    assert _blocked(room, room.start, room.target)
    (low_x, high_x), (low_y, high_y) = room.area
    for x, y in (room.target, *(mark.place for mark in marks(room))):
        cell = int((x - low_x) / (high_x - low_x) * CELLS[0]), int((y - low_y) / (high_y - low_y) * CELLS[1])
        assert room.reachable()[cell]


def test_only_the_first_stone_lies_before_the_wall() -> None:
    room = ROOMS["stones"]
    assert room.start is not None
    assert not _blocked(room, room.start, STONES[0])
    assert _blocked(room, STONES[0], STONES[1])
    assert not _blocked(room, STONES[1], STONES[2])
    assert [mark.place for mark in marks(room)] == list(STONES)
    assert [mark.target for mark in marks(room)] == [False, False, True]


def test_the_rooms_with_and_without_stones_have_the_same_walls_and_way() -> None:
    stones, plain = ROOMS["stones"], ROOMS["difficult"]
    assert (stones.boxes, stones.area, stones.start, stones.target) == (
        plain.boxes,
        plain.area,
        plain.start,
        plain.target,
    )


@pytest.mark.parametrize("name", ROOMS)
def test_the_ant_s_legs_touch_no_wall_at_the_start(name: str) -> None:
    room = ROOMS[name]
    assert room.start is not None
    model = scene(ANT, room.boxes).whole
    data = mujoco.MjData(model)
    data.qpos[:] = scene(ANT, room.boxes).start
    data.qpos[:2] = room.start
    mujoco.mj_forward(model, data)
    touching = set(data.contact.geom.ravel().tolist())
    assert not touching & set(box_geoms(model).tolist())
    data.qpos[:2] += room.boxes[0].centre - data.geom_xpos[max(touching), :2]  # a foot in a wall is noticed
    mujoco.mj_forward(model, data)
    assert set(data.contact.geom.ravel().tolist()) & set(box_geoms(model).tolist())
