"""The animated picture of an episode: its frames, their pace, and where the robot is in them."""

from __future__ import annotations

import io

import numpy as np
import pytest
from numpy.typing import NDArray

from evoclaims.core.drawing import optional
from evoclaims.envs.ecorobot.locomotion import Obstacles
from evoclaims.envs.ecorobot.stones import SteppingStones
from evoclaims.envs.ecorobot.views import pictures as films
from evoclaims.envs.ecorobot.views.motion import motion
from evoclaims.envs.ecorobot.views.pictures import FRAME, film

MAZE, RUN = SteppingStones(), Obstacles()
ROLLING = np.stack([np.linspace(-3.0, 3.0, 7), np.full(7, 1.5), np.zeros(7)], axis=1)


def _frames(gif: bytes) -> list[NDArray[np.uint8]]:
    """Return red, green and blue of each frame's pixels, shapes [rows, columns, 3]."""
    image, frames = optional("PIL.Image").open(io.BytesIO(gif)), []
    assert image.info["loop"] == 0
    for frame in range(image.n_frames):
        image.seek(frame)
        assert image.info["duration"] == FRAME
        frames.append(np.asarray(image.convert("RGB")))
    return frames


def _robot(frame: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return the mean column and row of the pixels that are blue as the robot is, and how many there are."""
    rows, columns = np.nonzero(np.abs(frame.astype(int) - [0x2F, 0x6F, 0xB5]).max(axis=-1) < 25)
    return np.array([columns.mean(), rows.mean(), len(rows)])


def test_a_film_has_a_frame_for_each_step_and_one_robot_moves_in_it() -> None:
    frames = _frames(film(MAZE, motion(MAZE.scene, ROLLING), "rolling"))
    assert len(frames) == 7
    columns, rows, sizes = np.array([_robot(frame) for frame in frames]).T
    steps = np.diff(columns)
    assert steps.mean() > 40
    np.testing.assert_allclose(steps, steps.mean(), atol=3)
    np.testing.assert_allclose(rows, rows[0], atol=2)
    np.testing.assert_allclose(sizes, sizes[0], rtol=0.1)


def test_of_a_long_episode_frames_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(films, "MOST_FRAMES", 3)
    shown = motion(MAZE.scene, ROLLING)
    frames, all_frames = _frames(film(MAZE, shown, "")), _frames(film(MAZE, shown.every(3), ""))
    assert len(frames) == 3
    for frame, expected in zip(frames, all_frames, strict=True):
        np.testing.assert_array_equal(frame, expected)


def test_the_camera_goes_along_with_a_runner() -> None:
    positions = np.repeat(RUN.scene.start[None], 3, axis=0)
    positions[:, 0] = [0.0, 9.0, 40.0]
    frames = _frames(film(RUN, motion(RUN.scene, positions), "running"))
    assert len(frames) == 3
    places = np.array([_robot(frame) for frame in frames])
    np.testing.assert_allclose(places[:, :2], np.tile(places[0, :2], (3, 1)), atol=3)


def test_a_long_title_is_broken_and_not_cut() -> None:
    shown = motion(MAZE.scene, ROLLING[:1])
    (short,), (long,) = (_frames(film(MAZE, shown, title)) for title in ("word", "words and " * 12))
    assert short.shape == long.shape
    assert (long[:, [0, -1]] == 255).all()
