"""The page of an episode: what is in it comes out again bit by bit, is text only, and asks for nothing else."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from evoclaims.envs.ecorobot.obstacles import Obstacles
from evoclaims.envs.ecorobot.stones import STONES, SteppingStones
from evoclaims.envs.ecorobot.views import page as pages
from evoclaims.envs.ecorobot.views.motion import Mark, Motion, motion
from evoclaims.envs.ecorobot.views.page import page

MAZE, RUN = SteppingStones(), Obstacles()
DATA = re.compile(r'<script type="application/json" id="data">(.*?)</script>', re.DOTALL)


def _motion(task: Any, frames: int = 4) -> Motion:
    """Return a motion with a different position in each frame."""
    steps = np.random.default_rng(0).normal(size=(frames, task.scene.whole.nq))
    return motion(task.scene, task.scene.start + steps)


def _data(text: str) -> dict[str, Any]:
    """Return what the viewer reads."""
    (found,) = DATA.findall(text)
    data: dict[str, Any] = json.loads(found)
    return data


def _floats(packed: str, *shape: int) -> NDArray[np.float32]:
    """Return an array as the viewer unpacks it."""
    return np.frombuffer(base64.b64decode(packed), "<f4").reshape(shape)


@pytest.mark.parametrize("task", [MAZE, RUN], ids=["maze", "course"])
def test_every_bit_of_what_moves_comes_out_again(task: Any) -> None:
    shown = _motion(task)
    data = _data(page(task, shown, "").decode())
    moves = [shape.moves for shape in shown.shapes]
    assert [shape["moves"] for shape in data["shapes"]] == moves
    poses = _floats(data["poses"], 4, sum(moves), 7)
    np.testing.assert_array_equal(poses[..., :3], shown.places[:, moves])
    np.testing.assert_array_equal(poses[..., 3:], shown.turns[:, moves])
    np.testing.assert_array_equal(_floats(data["torso"], 4, 3), shown.torso)
    assert (data["frames"], data["seconds"]) == (4, task.scene.seconds)


@pytest.mark.parametrize("task", [MAZE, RUN], ids=["maze", "course"])
def test_what_stands_still_is_given_once(task: Any) -> None:
    data = _data(page(task, _motion(task), "").decode())
    still = [shape for shape in data["shapes"] if not shape["moves"]]
    for shape, box in zip(still, task.boxes, strict=True):
        assert shape["kind"] == "box"
        np.testing.assert_allclose(shape["pose"][:3], box.place, atol=1e-6)
        np.testing.assert_allclose(shape["radii"], box.size)


def test_marks_are_given_with_the_target_last() -> None:
    marks = _data(page(MAZE, _motion(MAZE), "").decode())["marks"]
    assert [tuple(mark["place"]) for mark in marks] == list(STONES)
    assert [mark["text"] for mark in marks] == ["1", "2", "3", "4", "5", "6", "7 target"]
    assert [mark["target"] for mark in marks] == [False] * 6 + [True]


def test_a_maze_is_seen_as_a_whole_and_a_runner_is_followed() -> None:
    maze, run = (_data(page(task, _motion(task), "").decode())["view"] for task in (MAZE, RUN))
    assert (maze["target"], maze["follow"]) == ([0.0, 3.5, 0.0], False)
    np.testing.assert_array_equal(np.float32(run["target"]), _motion(RUN).torso[0])
    assert run["follow"]


def test_a_hostile_title_stays_text() -> None:
    title = '</title><script>alert("$data")</script>&amp;${script}'
    text = page(MAZE, _motion(MAZE), title).decode()
    assert text.count(html.escape(title)) == 2
    assert "<script>alert" not in text
    assert text.count("<script") == text.count("</script>") == 2
    assert text.count("<title>") == text.count("</title>") == 1


def test_a_hostile_label_stays_data(monkeypatch: pytest.MonkeyPatch) -> None:
    label = "</script><script>alert(1)</script><!--<script>"
    monkeypatch.setattr(pages, "marks", lambda task: (Mark((0.0, 1.0), 0.5, label),))
    text = page(MAZE, _motion(MAZE), "").decode()
    assert text.count("<script") == text.count("</script>") == 2
    (mark,) = _data(text)["marks"]
    assert mark["text"] == label


def test_the_page_asks_for_nothing_and_forbids_the_browser_to() -> None:
    text = page(MAZE, _motion(MAZE), "").decode()
    assert 'http-equiv="Content-Security-Policy" content="default-src \'none\';' in text
    (script,) = re.findall(r"<script>(.*?)</script>", text, re.DOTALL)
    assert f"script-src 'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}';" in text
    assert not re.search(r"https?:|\bsrc=|\bhref=|url\(|\bimport\b|fetch\(|XMLHttpRequest", text)


def test_all_that_the_viewer_looks_up_is_in_the_page() -> None:
    text = page(MAZE, _motion(MAZE), "").decode()
    wanted = set(re.findall(r'(?:control|getElementById)\("([a-z]+)"\)', text))
    assert {"canvas", "data", "play", "scrub", "speed", "follow", "reset", "time"} <= wanted
    assert wanted <= set(re.findall(r'\bid="([a-z]+)"', text))


def test_the_viewer_can_draw_every_kind_of_shape() -> None:
    text = page(MAZE, _motion(MAZE), "").decode()
    (meshes,) = re.findall(r"const MESHES = \{(.*?)\};", text, re.DOTALL)
    assert set(re.findall(r"(\w+): \(s\)", meshes)) == {"sphere", "ellipsoid", "capsule", "cylinder", "box"}
