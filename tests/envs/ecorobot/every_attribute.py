"""Every attribute of MuJoCo's XML: a robot with it is simulated as MuJoCo in C does, or refused with a sentence.

All of them take minutes, so the suite has a sample: run `python tests/envs/ecorobot/every_attribute.py`.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from xml.etree import ElementTree

import jax
import mujoco
import numpy as np
import pytest
from custom_robots import BASE, Texts

from evoclaims.core.errors import UserError
from evoclaims.envs.ecorobot import fidelity, model_files, physics
from evoclaims.envs.ecorobot.robots import Robot
from evoclaims.envs.ecorobot.scene import Scene
from evoclaims.kernels import in_numpy

TOLERANCE = 1e-9
FRAMES = 50
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


def with_attribute(element: str, attribute: str, value: str) -> str:
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
                text = with_attribute(element, attribute, value)
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
    """What a frame needs of a scene besides arrays; equal ones share a trace."""

    kinds: tuple[int, ...]
    robot: Any
    newton_steps: int
    damps_implicitly: bool
    integrates_by_rk4: bool


class _Built:
    """A scene whose arrays are a trace's arguments."""

    def __init__(self, world: _World, arrays: Any, blank: Any) -> None:
        vars(self).update(vars(world))
        self.mjx, self.blank = arrays, blank
        self.model = type("Model", (), {"geom_type": np.array(world.kinds)})


@partial(jax.jit, static_argnums=0)
def _stepped(world: _World, scene: Any, *state: Any) -> tuple[Any, Any]:
    body: Any = physics._frame.__wrapped__(_Built(world, *scene), physics.Body(*state[:3]), state[3], {})
    return body.position, body.velocity


def furthest(robot: Robot) -> float:
    """Return how far single frames are from C MuJoCo's, as a share of 1 + the largest number.

    Raises:
        UserError: when the robot is refused.
    """
    with pytest.MonkeyPatch.context() as fewer:
        for name, number in {"RUNS": 2, "FRAMES": FRAMES // 2, "EVERY": 1}.items():
            fewer.setattr(fidelity, name, number)
        made = fidelity.frames_of(Scene(robot))
    with jax.enable_x64(True):
        scene = Scene(robot)
        numbers = {"touching": 4, "contacts": robot.contacts, "is_built_in": False}
        kinds = _ALIKE.setdefault(robot.contacts, type("Kinds", (), numbers))
        world = _World(
            tuple(scene.model.geom_type.tolist()),
            kinds,
            scene.newton_steps,
            scene.damps_implicitly,
            scene.integrates_by_rk4,
        )
        leaves, tree = jax.tree.flatten((scene.mjx, scene.blank))

        def frame(*arrays: Any) -> tuple[Any, Any]:
            return _stepped(world, jax.tree.unflatten(tree, arrays[4:]), *arrays[:4])

        states = (made.position, made.velocity, made.acceleration, made.control)
        ours = np.concatenate(in_numpy(frame, *states, *(np.asarray(leaf)[None] for leaf in leaves)), axis=1)
    theirs = np.concatenate([made.next_position, made.next_velocity], axis=1)
    return float(np.max(np.max(np.abs(ours - theirs), axis=1) / (1 + np.max(np.abs(theirs), axis=1))))


_ALIKE: dict[int, Any] = {}
"""The same object for the same numbers, so that traces are shared."""


def main() -> None:
    """Print each attribute's end: refused, or how far a robot with it is from MuJoCo in C."""
    counts = Counter[str]()
    with TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as monkeypatch:
        texts = Texts(Path(folder), monkeypatch)
        for name, text in variants():
            try:
                off = furthest(texts.robot(text, frames=1, contacts=12))
                end = "equal" if off < TOLERANCE else "unclear" if off <= fidelity.TOLERANCE else "refused by frames"
                counts[end] += 1
                print(end, f"{off:.1e}", name, flush=True)
            except UserError as error:
                counts["refused"] += 1
                print("refused", name, error, flush=True)
    print(f"{counts.total()} models: {dict(counts)}")


if __name__ == "__main__":
    main()
