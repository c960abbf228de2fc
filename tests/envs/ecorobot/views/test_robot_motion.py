"""Bodies in space over time, against places and outlines worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from evoclaims.core.errors import UserError
from evoclaims.envs.ecorobot.boxes import Box
from evoclaims.envs.ecorobot.deceptive import DeceptiveMaze
from evoclaims.envs.ecorobot.locomotion import PLACES, Obstacles
from evoclaims.envs.ecorobot.robots import ANT
from evoclaims.envs.ecorobot.scene import scene
from evoclaims.envs.ecorobot.stones import PLAN, SteppingStones
from evoclaims.envs.ecorobot.views.motion import at_start, motion

STONES, RUN, ANT_MAZE = SteppingStones(), Obstacles(), DeceptiveMaze(robot=ANT)


def test_a_ball_is_where_its_position_says_and_turns_with_its_heading() -> None:
    shown = motion(STONES.scene, np.array([[-3.0, 1.0, 0.0], [0.5, 6.5, math.pi / 2]]))
    (ball,) = [i for i, shape in enumerate(shown.shapes) if shape.moves]
    assert (shown.shapes[ball].kind, shown.shapes[ball].radii) == ("sphere", (0.2, 0.2, 0.2))
    np.testing.assert_allclose(shown.places[:, ball], [[-3.0, 1.0, 0.2], [0.5, 6.5, 0.2]], atol=1e-6)
    np.testing.assert_array_equal(shown.places[:, ball], shown.torso)
    half = math.sqrt(0.5)
    np.testing.assert_allclose(shown.turns[:, ball], [[1, 0, 0, 0], [half, 0, 0, half]], atol=1e-6)


def test_a_turned_ant_turns_as_a_whole() -> None:
    position = ANT_MAZE.scene.start.astype(np.float64)
    turned = position.copy()
    # A quarter turn about the vertical, at another place.
    turned[:7] = [1.0, 2.0, position[2], math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]
    shown = motion(ANT_MAZE.scene, np.stack([position, turned]))
    moves = [shape.moves for shape in shown.shapes]
    first, second = shown.places[:, moves]
    expected = np.stack([1.0 - first[:, 1], 2.0 + first[:, 0], first[:, 2]], axis=1)
    np.testing.assert_allclose(second, expected, atol=1e-5)
    assert sum(moves) == 17  # the torso, and of each leg three capsules and a foot


def test_walls_stand_still_where_they_are_built() -> None:
    shown = motion(ANT_MAZE.scene, np.repeat(ANT_MAZE.scene.start[None], 3, axis=0))
    still = [i for i, shape in enumerate(shown.shapes) if not shape.moves]
    for i, box in zip(still, ANT_MAZE.boxes, strict=True):
        np.testing.assert_allclose(shown.places[:, i], np.tile(box.place, (3, 1)), atol=1e-6)
        np.testing.assert_allclose(shown.shapes[i].radii, box.size)


def test_all_obstacles_are_shown_though_few_are_simulated() -> None:
    shown = at_start(RUN)
    across = sorted(place[0] for place, shape in zip(shown.places[0], shown.shapes, strict=True) if not shape.moves)
    np.testing.assert_allclose(across, PLACES, atol=1e-5)


def test_a_maze_starts_with_the_robot_at_its_start() -> None:
    shown = at_start(STONES)
    assert shown.frames == 1
    np.testing.assert_allclose(shown.torso[0], [*PLAN.start, 0.2], atol=1e-6)


def test_nothing_is_shown_from_the_first_frame_on_that_is_not_finite() -> None:
    positions = np.zeros((5, 3))
    positions[2, 1] = np.nan
    assert motion(STONES.scene, positions).frames == 2
    positions[0, 0] = np.inf
    with pytest.raises(UserError, match="not finite from the first step on"):
        motion(STONES.scene, positions)


def test_every_third_frame_keeps_the_first_and_the_pace() -> None:
    positions = np.zeros((8, 3))
    positions[:, 0] = np.arange(8)
    shown = motion(STONES.scene, positions).every(3)
    np.testing.assert_allclose(shown.torso[:, 0], [0, 3, 6])
    assert shown.seconds == pytest.approx(3 * STONES.scene.seconds)
    assert len(shown.places) == len(shown.turns) == 3


def test_a_turned_wall_seen_from_above_is_its_rectangle() -> None:
    walls = (Box((1.0, 2.0), (3.0, 0.5), angle=30.0),)
    built = scene(STONES.robot, walls)
    shown = motion(built, np.zeros((1, 3)))
    (wall,) = [i for i, shape in enumerate(shown.shapes) if not shape.moves]
    outline = shown.outline(wall, 0, (0, 1)) - [1.0, 2.0]
    back = np.array([[math.cos(math.pi / 6), math.sin(math.pi / 6)], [-math.sin(math.pi / 6), math.cos(math.pi / 6)]])
    corners = outline @ back.T
    np.testing.assert_allclose(np.abs(corners), np.tile([3.0, 0.5], (len(corners), 1)), atol=1e-5)
    assert {tuple(np.sign(corner)) for corner in corners} == {(1, 1), (1, -1), (-1, 1), (-1, -1)}


def test_a_capsule_is_as_long_and_as_thick_from_the_side_as_its_file_says() -> None:
    shown = at_start(RUN)
    # The half-cheetah's torso: a capsule from x = -0.5 to 0.5 with a radius of 0.046 m, lying along x.
    (torso,) = [i for i, shape in enumerate(shown.shapes) if shape.kind == "capsule" and shape.reach == 0.5]
    assert np.ptp(shown.outline(torso, 0, (0, 2)), axis=0) == pytest.approx([1.092, 0.092], abs=2e-3)
