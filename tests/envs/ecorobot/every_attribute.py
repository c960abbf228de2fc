"""Every attribute of MuJoCo's XML: a robot with it is simulated as MuJoCo in C does, or refused with a sentence.

It compiles for many minutes, so it is no test of the suite: run `python tests/envs/ecorobot/every_attribute.py`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from xml.etree import ElementTree

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from custom_robots import BASE, Texts

from evoclaims.core.errors import UserError
from evoclaims.envs.ecorobot import fidelity, model_files, physics
from evoclaims.envs.ecorobot.fidelity import Frames
from evoclaims.envs.ecorobot.physics import Body
from evoclaims.envs.ecorobot.robots import Robot
from evoclaims.envs.ecorobot.scene import Scene

ACTUATORS = (
    "general",
    "motor",
    "position",
    "velocity",
    "intvelocity",
    "pid",
    "damper",
    "cylinder",
    "muscle",
    "adhesion",
)
ELEMENTS = ("compiler", "option", "flag", "body", "inertial", "freejoint", "joint", "geom", "site", *ACTUATORS)
VALUES = [
    "0.37",
    "2",
    "true",
    "false",
    "enable",
    "disable",
    "0.3 0.7",
    "-0.7 0.2",
    "0.1 0.2 0.3",
    "0.1 0.2 0.3 0.4",
    "0.3 0.4 0.5 0.6 0.7",
    "0.1 1 0.2 1 0 1",
]
WORDS = [
    "RK4",
    "implicit",
    "implicitfast",
    "elliptic",
    "sparse",
    "PGS",
    "CG",
    "radian",
    "XYZ",
    "hinge",
    "slide",
    "ball",
    "box",
    "ellipsoid",
    "cylinder",
    "sphere",
    "integrator",
    "filter",
    "filterexact",
    "muscle",
    "affine",
    "knee",
    "tip",
    "body",
    "shell",
    "auto",
    "never",
    "init",
]


def _schema() -> dict[str, set[str]]:
    """Return the attributes of each element, as MuJoCo prints them."""
    found: dict[str, set[str]] = {}
    names: set[str] = set()
    for line in mujoco.mj_printSchema(False, False).splitlines():
        if begins := re.match(r" *(?:\(world\))?(\w+) \(.\) *(.*)", line):
            names, words = found.setdefault(begins[1], set()), begins[2]
        else:
            words = line
        names.update(words.split())
    return found


def _with(element: str, attribute: str, value: str) -> str:
    """Return the base model with an attribute of an element."""
    tree = ElementTree.fromstring(BASE)
    if element in ACTUATORS:
        (motor,) = tree.findall("actuator/general")
        if motor.tag != element:
            motor.tag = element
            motor.attrib.pop("gainprm")
            if element == "adhesion":
                motor.attrib.pop("joint")
                motor.set("body", "world")
        motor.set(attribute, value)
    elif element == "flag":
        ElementTree.SubElement(tree.find("option"), "flag").set(attribute, value)  # type: ignore[arg-type]
    elif element == "inertial":
        inertial = {"pos": "0.1 0 0", "mass": "0.5", "diaginertia": "0.01 0.01 0.01", attribute: value}
        if attribute == "fullinertia":
            inertial.pop("diaginertia")
        tree.findall(".//body")[1].insert(0, ElementTree.Element("inertial", inertial))
    else:
        tree.findall(f".//{element}")[-1].set(attribute, value)
    return ElementTree.tostring(tree, encoding="unicode")


def variants() -> Iterator[tuple[str, str]]:
    """Yield names and texts of models that differ from the base in one attribute, and in what they are made of."""
    own = model_files.body_hash(mujoco.MjModel.from_xml_string(BASE))
    schema = _schema()
    for element in ELEMENTS:
        for attribute in sorted(schema[element] - {"name", "class", "childclass", "user"}):
            seen = {own}
            for value in (*VALUES, *WORDS):
                text = _with(element, attribute, value)
                try:
                    made = model_files.body_hash(mujoco.MjModel.from_xml_string(text))
                except ValueError:
                    continue
                if made not in seen:
                    seen.add(made)
                    yield f"{element} {attribute}={value}", text
                if len(seen) > 2:
                    break


@dataclass(frozen=True)
class _World:
    """What a frame needs of a scene besides arrays; equal ones share a compiled program."""

    kinds: tuple[int, ...]
    robot: Any
    newton_steps: int
    damps_implicitly: bool


class _Built:
    """A scene whose arrays are a program's arguments."""

    def __init__(self, world: _World, arrays: Any, blank: Any) -> None:
        self.robot, self.newton_steps, self.damps_implicitly = world.robot, world.newton_steps, world.damps_implicitly
        self.mjx, self.blank = arrays, blank
        self.model = type("Model", (), {"geom_type": np.array(world.kinds)})


@partial(jax.jit, static_argnums=0, compiler_options={"xla_backend_optimization_level": 0})
def _stepped(world: _World, arrays: Any, blank: Any, states: Any) -> Body:
    def frame(position: Any, velocity: Any, acceleration: Any, control: Any) -> Body:
        body = Body(position=position, velocity=velocity, acceleration=acceleration)
        return physics._frame.__wrapped__(_Built(world, arrays, blank), body, control, {})

    return jax.vmap(frame)(*states)


def furthest(robot: Robot, frames: int = 50) -> float:
    """Return how far single frames are from C MuJoCo's, as a share of 1 + the speed, along its own run of the file."""
    model = mujoco.MjModel.from_xml_path(robot.file)
    data, random = mujoco.MjData(model), np.random.default_rng(1)
    data.qvel[:] = 0.5 * random.standard_normal(model.nv)
    rows = []
    for frame in range(frames):
        if frame % 5 == 0:
            data.ctrl[:] = random.uniform(-1.5, 1.5, model.nu)
        before = [data.qpos.copy(), data.qvel.copy(), data.qacc_warmstart.copy(), data.ctrl.copy()]
        mujoco.mj_step(model, data)
        if not np.max(np.abs(data.qvel)) < fidelity.FASTEST:  # such as with a timestep of 2 s: C itself diverges
            break
        rows.append([*before, data.qpos.copy(), data.qvel.copy(), np.zeros(12), data.ncon])
    if not rows:
        return 0.0
    made = Frames(*(np.array(column) for column in zip(*rows, strict=True)))
    with jax.enable_x64(True):
        scene = Scene(robot)
        kinds = type("Kinds", (), {"touching": robot.contacts, "is_built_in": robot.is_built_in})
        world = _World(tuple(scene.model.geom_type.tolist()), _alike(kinds), scene.newton_steps, scene.damps_implicitly)
        states = [jnp.array(x) for x in (made.position, made.velocity, made.acceleration, made.control)]
        body = jax.device_get(_stepped(world, scene.mjx, scene.blank, states))
    off = np.abs(np.concatenate([body.position - made.next_position, body.velocity - made.next_velocity], axis=1))
    return float(np.max(np.max(off, axis=1) / (1 + np.max(np.abs(made.next_velocity), axis=1))))


_ALIKE: dict[tuple[int, bool], Any] = {}


def _alike(kinds: Any) -> Any:
    """Return the same object for the same numbers, so that programs are shared."""
    return _ALIKE.setdefault((kinds.touching, kinds.is_built_in), kinds)


def main() -> None:
    """Print each attribute's end: refused, or how far a robot with it is from MuJoCo in C."""
    with TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as monkeypatch:
        texts = Texts(Path(folder), monkeypatch)
        for name, text in variants():
            try:
                print(f"{furthest(texts.robot(text, frames=1, contacts=12)):.1e}", name, flush=True)
            except UserError as error:
                print("refused", name, error, flush=True)


if __name__ == "__main__":
    main()
