"""Pictures of tasks, paths and elites: what is in them, and where."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from evoclaims.core.drawing import optional
from evoclaims.core.errors import UnknownNameError
from evoclaims.envs.ecorobot.deceptive import DeceptiveMaze
from evoclaims.envs.ecorobot.locomotion import Locomotion, Obstacles
from evoclaims.envs.ecorobot.robots import ANT
from evoclaims.envs.ecorobot.stones import STONES, SteppingStones
from evoclaims.envs.ecorobot.views.pictures import (
    PATHS,
    STONE,
    TARGET,
    WALL,
    draw,
    paint_elites,
    paint_ground,
    paint_paths,
)

pytestmark = pytest.mark.newest

MAZE = SteppingStones()
PATH = np.stack([np.linspace(-3.0, 2.0, 30), np.linspace(1.0, 1.5, 30), np.full(30, 0.2)], axis=1)


def _texts(svg: bytes) -> list[str]:
    """Return the texts of a picture."""
    return re.findall(r"<text[^>]*>([^<]*)</text>", svg.decode())


def _axis() -> Any:
    return optional("matplotlib.figure").Figure().add_subplot()


@pytest.mark.parametrize(
    ("task", "paths", "told"),
    [
        (
            MAZE,
            [],
            {
                *("a title", "simple_rob at the start, to scale", "wall", "x, m", "y, m", *map(str, range(1, 8))),
                *("stones, to be crossed in order (within 0.1 m)", "target (within 0.1 m)"),
            },
        ),
        (MAZE, [PATH, PATH], {"paths of the torso in 2 episodes, and their ends"}),
        (
            Obstacles(),
            [PATH],
            {
                *("half_cheetah at the start, to scale", "path of the torso, its end"),
                *(f"{i}: {height} m" for i, height in enumerate([0.1] * 5 + [0.2] * 5 + [0.3] * 5, start=1)),
            },
        ),
        (Locomotion(robot=ANT), [PATH], {"ant at the start, to scale"}),
    ],
    ids=["maze", "paths", "course", "no walls"],
)
def test_a_picture_tells_what_is_to_be_seen(task: Any, paths: list[Any], told: set[str]) -> None:
    texts = _texts(draw(task, paths, "a title", "svg"))
    assert told <= set(texts)
    assert any("path" in text for text in texts) == bool(paths)


def test_the_ground_has_each_wall_and_each_mark_at_its_place() -> None:
    colours, axis = optional("matplotlib.colors"), _axis()
    paint_ground(axis, MAZE, [])

    def of(colour: str) -> list[Any]:
        return [patch for patch in axis.patches if patch.get_facecolor()[:3] == colours.to_rgb(colour)]

    for wall, box in zip(of(WALL), MAZE.boxes, strict=True):
        corners = wall.get_xy()[:-1]
        away = np.abs((corners - np.array(box.centre)) @ box.rotation[:2, :2])
        np.testing.assert_allclose(away, np.tile(box.half_size, (len(corners), 1)), atol=1e-5)
    assert [(mark.center, mark.radius) for mark in of(STONE) + of(TARGET)] == [(stone, 0.1) for stone in STONES]


def test_the_easy_mazes_target_is_as_wide_as_it_counts() -> None:
    axis = _axis()
    paint_ground(axis, DeceptiveMaze(), [])
    (target,) = [patch for patch in axis.patches if hasattr(patch, "radius")]
    assert (target.center, target.radius) == ((-4.0, 9.0), 1.1)


@pytest.mark.parametrize("plane", [(0, 1), (0, 2)])
def test_a_path_is_a_line_through_its_places_with_a_sign_at_its_end(plane: tuple[int, int]) -> None:
    axis = _axis()
    paint_paths(axis, [PATH, PATH[:4]], plane)
    first, first_end, second, second_end = axis.get_lines()
    np.testing.assert_array_equal(first.get_xydata(), PATH[:, plane])
    np.testing.assert_array_equal(first_end.get_xydata(), PATH[-1:, plane])
    np.testing.assert_array_equal(second_end.get_xydata(), PATH[3:4, plane])
    assert (first.get_color(), second.get_color()) == PATHS[:2]


def test_the_picture_reaches_as_far_as_a_path_that_leaves_the_maze() -> None:
    axis = _axis()
    paint_ground(axis, MAZE, [PATH + np.array([7.0, 0.0, 0.0])])
    assert axis.get_xlim()[1] == pytest.approx(9.5)
    assert axis.get_xlim()[0] == pytest.approx(-4.6)


def test_places_that_are_not_finite_are_left_out() -> None:
    broken = np.concatenate([PATH, np.full((3, 3), np.nan), np.full((1, 3), np.inf)])
    for task in (MAZE, Obstacles()):
        assert draw(task, [broken], "", "svg") == draw(task, [PATH], "", "svg")
        draw(task, [np.full((2, 3), np.nan)], "", "svg")


@pytest.mark.parametrize("file_format", ["svg", "png"])
def test_the_same_picture_has_the_same_bytes_whatever_the_users_style(file_format: str) -> None:
    first = draw(MAZE, [PATH], "twice", file_format)
    with optional("matplotlib").rc_context({"font.size": 30, "axes.facecolor": "black"}):
        assert draw(MAZE, [PATH], "twice", file_format) == first
    assert first.startswith({"svg": b"<?xml", "png": b"\x89PNG"}[file_format])


def test_a_hostile_title_stays_text() -> None:
    svg = draw(MAZE, [], "</text><script>alert(1)</script>", "svg").decode()
    assert "<script" not in svg
    assert "&lt;script&gt;alert(1)" in svg


def test_an_elite_is_painted_where_its_episode_ended() -> None:
    for (x, y), place in {(45, 5): (3.28, 0.77), (10, 45): (-2.32, 6.37)}.items():
        fitnesses = np.full((50, 50), -np.inf, np.float32)
        fitnesses[x, y] = 3.0
        mesh = paint_elites(_axis(), MAZE, fitnesses)
        ((row, column),) = np.argwhere(~np.ma.getmaskarray(mesh.get_array()))
        corners = mesh.get_coordinates()[row : row + 2, column : column + 2]
        np.testing.assert_allclose(corners.mean(axis=(0, 1)), place, atol=1e-6)
        np.testing.assert_allclose(np.ptp(corners, axis=(0, 1)), (0.16, 0.14), atol=1e-6)


def test_a_format_that_is_not_known_is_told() -> None:
    sentence = "There is no format of a picture named 'pgn'. Did you mean 'png'?"
    with pytest.raises(UnknownNameError, match=re.escape(sentence)):
        draw(MAZE, [], "", "pgn")
