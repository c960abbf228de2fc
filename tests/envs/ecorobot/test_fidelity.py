"""Before a custom robot is simulated, frames of its step are compared with MuJoCo's in C."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest
from custom_robots import BASE, Texts

from evoclaims.core.errors import UserError
from evoclaims.envs.ecorobot import fidelity, physics
from evoclaims.envs.ecorobot.boxes import Box
from evoclaims.envs.ecorobot.fidelity import check, require_fidelity, require_likeness
from evoclaims.envs.ecorobot.locomotion import Locomotion, Obstacles
from evoclaims.envs.ecorobot.physics import Body
from evoclaims.envs.ecorobot.robots import ANT
from evoclaims.envs.ecorobot.scene import Scene

SLIDER = """
<mujoco>
  <option timestep="0.02"/>
  <worldbody>
    <geom name="floor" type="plane" size="9 9 1"/>
    <body>
      <joint name="x" type="slide" axis="1 0 0" limited="true" range="-1 1" damping="1"/>
      <joint name="turn" type="hinge" axis="0 0 1" limited="true" range="-90 90" damping="1"/>
      <geom name="ball" type="sphere" pos="0.2 0 {height}" size="0.1"/>
    </body>
  </worldbody>
  <actuator><motor joint="x" gear="100" ctrllimited="true" ctrlrange="-3 3"/></actuator>
</mujoco>
"""
"""A ball that cannot leave its height."""


MANY_ATTRIBUTES = {
    "<option": '<option viscosity="0.37" wind="0.1 0.2 0.3"',
    '<body pos="0.3 0 0"': '<body pos="0.3 0 0" gravcomp="0.37"',
    'axis="0 1 0"': 'axis="0 1 0" ref="0.37" springref="0.37"',
    'type="capsule"': 'type="capsule" solmix="2"',
    '<general name="motor" joint="knee" ctrlrange="-1 1" gainprm="3"/>': '<position joint="knee" kp="3" kv="0.37"/>',
}


@pytest.mark.parametrize("integrator", ["Euler", "RK4"])
def test_attributes_of_a_file_move_a_robot_as_in_c(integrator: str, texts: Texts) -> None:
    text = BASE.replace("<option", f'<option integrator="{integrator}"')
    for plain, more in MANY_ATTRIBUTES.items():
        assert text.count(plain) == 1
        text = text.replace(plain, more)
    off, *_ = fidelity._differences(Scene(texts.robot(text, frames=1, contacts=12)))
    assert np.max(off) < 1e-9


def test_a_step_that_differs_by_a_millionth_is_refused(texts: Texts, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene(texts.robot(BASE), ())
    check(scene)
    monkeypatch.setattr(physics, "_frame", _off_by_a_millionth(physics._frame))
    with pytest.raises(UserError, match="rover is not simulated as its file says. In .* random states a frame"):
        check(scene)


def test_contact_at_distance_zero_is_refused_naming_geoms(texts: Texts) -> None:
    """As Gymnasium's point: it slides on the floor, and MuJoCo in C itself goes elsewhere by rounding errors."""
    text = SLIDER.format(height=0.1)
    with pytest.raises(UserError, match="decided by rounding errors there, since the geoms floor and ball are exactly"):
        check(Scene(texts.robot(text)))


def test_a_solver_that_stops_early_is_refused_naming_it(texts: Texts) -> None:
    loose = SLIDER.format(height=0.0999)
    with pytest.raises(UserError, match=r"stops before the minimum there \(tolerance=1e-08\)"):
        check(Scene(texts.robot(loose)))
    check(Scene(texts.robot(loose.replace('timestep="0.02"', 'timestep="0.02" tolerance="1e-14"'))))


TABLE = """
<mujoco>
  <option timestep="0.002"/>
  <worldbody>
    <geom type="plane" size="9 9 1"/>
    <body pos="0 0 1.6">
      <freejoint/>
      <geom size="0.1" pos="0 0 0.1"/>
      {feet}
    </body>
  </worldbody>
</mujoco>
"""
"""A robot with many feet, which falls for longer than a run lasts."""


def test_a_robot_that_starts_high_is_checked_on_the_floor(texts: Texts) -> None:
    feet = "".join(f'<geom size="0.05" pos="{x} {y} 0"/>' for x in (-0.4, -0.1, 0.2, 0.5) for y in (-0.3, 0.0, 0.3))
    with pytest.raises(UserError, match=r"touches at \d+ points at a time, but only contacts=4"):
        check(Scene(texts.robot(TABLE.format(feet=feet), contacts=4)))


def test_a_robot_is_checked_once_a_machine(texts: Texts, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    checked: list[Scene] = []
    monkeypatch.setattr(fidelity, "check", checked.append)
    cache = tmp_path / "cache"

    def checks(scene: Scene) -> int:
        require_fidelity.cache_clear()
        checked.clear()
        require_fidelity(scene)
        return len(checked)

    scene = Scene(texts.robot(BASE))
    with _cached_in(cache):
        assert checks(Scene(ANT)) == 0
        assert [checks(scene), checks(scene)] == [1, 0]
        assert checks(Scene(scene.robot, (Box((3.0, 3.0), (0.1, 0.1)),))) == 1
        assert checks(Scene(texts.robot(BASE.replace('damping="0.3"', 'damping="0.4"')))) == 1
        assert checks(Scene(texts.robot(BASE, contacts=3))) == 1
        (cache / "robots").chmod(0o777)
        assert [checks(scene), checks(scene)] == [1, 1]
        (cache / "robots").chmod(0o700)
        for record in (cache / "robots").iterdir():
            record.write_bytes(b"")
        assert [checks(scene), checks(scene)] == [1, 0]


def test_a_release_that_moves_our_robots_otherwise_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    check(Scene(ANT, ()))
    monkeypatch.setattr(physics, "_frame", _off_by_a_millionth(physics._frame))
    with pytest.raises(UserError, match=r"ant does not move as MuJoCo in C says: of 288 random frames \d+ .* MJX 3\."):
        check(Scene(ANT, ()))


def test_our_robots_are_checked_when_a_step_is_traced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Once a process, whatever boxes there are; not when a task is planned."""
    checked: list[Scene] = []
    monkeypatch.setattr(fidelity, "check", checked.append)
    task = Obstacles()
    with _cached_in(tmp_path):
        require_likeness.cache_clear()
        task.check()
        state = jax.eval_shape(task.reset, jax.random.key(0), 0)
        assert not checked
        for _ in range(2):
            jax.eval_shape(task.plain_step, state, jax.ShapeDtypeStruct((task.action_size,), "float32"))
    assert checked == [Scene(task.robot, ())]


def test_a_robot_that_is_refused_is_checked_again(
    texts: Texts, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(scene: Scene) -> None:
        raise UserError("refused")

    monkeypatch.setattr(fidelity, "check", refuse)
    task = Locomotion(robot=texts.robot(BASE))
    with _cached_in(tmp_path / "cache"):
        for _ in range(2):
            with pytest.raises(UserError, match="refused"):
                task.check()
            with pytest.raises(UserError, match="refused"):
                _ = task.observation_size


def _off_by_a_millionth(frame: Callable[..., Body]) -> Callable[..., Body]:
    def faulty(*arguments: Any) -> Body:
        body = frame(*arguments)
        return replace(body, velocity=body.velocity * (1 + 1e-6))

    return faulty


@contextmanager
def _cached_in(folder: Path) -> Iterator[None]:
    """Keep what is compiled in a folder."""
    config: Any = jax.config
    before = config.jax_compilation_cache_dir
    config.update("jax_compilation_cache_dir", str(folder))
    try:
        yield
    finally:
        config.update("jax_compilation_cache_dir", before)
