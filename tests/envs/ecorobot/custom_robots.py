"""Robots from texts, as a user would write them."""

from __future__ import annotations

from itertools import count
from pathlib import Path
from typing import Any

import pytest

from evoclaims.envs.ecorobot.robots import Robot

_NUMBERS = count(1)

BASE = """
<mujoco>
  <compiler autolimits="true"/>
  <option timestep="0.01"/>
  <worldbody>
    <geom type="plane" size="9 9 1"/>
    <body pos="0 0 0.12">
      <freejoint/>
      <geom type="sphere" size="0.1"/>
      <body pos="0.3 0 0">
        <joint name="knee" axis="0 1 0" range="-40 40" damping="0.3" stiffness="0.5" armature="0.01"/>
        <geom name="shin" type="capsule" fromto="0 0 0 0.2 0 0" size="0.05"/>
        <site name="tip" pos="0.2 0 0"/>
      </body>
    </body>
  </worldbody>
  <actuator><general name="motor" joint="knee" ctrlrange="-1 1" gainprm="3"/></actuator>
</mujoco>
"""
"""A sphere on the floor with a leg: limits, damping, springs and contacts."""


class Texts:
    """A package of models."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        """Make an empty package, with a name of its own, since Python caches packages."""
        self.folder = folder / f"robots_{next(_NUMBERS)}_{folder.name}"
        self.folder.mkdir()
        (self.folder / "__init__.py").touch()
        monkeypatch.syspath_prepend(folder)

    def robot(self, text: str, name: str = "rover", **numbers: Any) -> Robot:
        """Return a robot whose model is a text."""
        (self.folder / f"{name}.xml").write_text(text)
        return Robot(name, f"{self.folder.name}:{name}.xml", **numbers)
