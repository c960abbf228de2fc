"""Before a custom robot is simulated, frames of its step are compared with MuJoCo's in C."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from custom_robots import BASE, Texts

from evoclaims.core.errors import UserError
from evoclaims.envs.ecorobot import physics
from evoclaims.envs.ecorobot.fidelity import require_fidelity
from evoclaims.envs.ecorobot.scene import Scene


def test_a_step_that_differs_by_a_millionth_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene(Texts(tmp_path, monkeypatch).robot(BASE), ())
    require_fidelity(scene)
    frame = physics._frame

    def faulty(*arguments: Any) -> Any:
        body = frame(*arguments)
        return replace(body, velocity=body.velocity * (1 + 1e-6))

    monkeypatch.setattr(physics, "_frame", faulty)
    with pytest.raises(UserError, match="rover is not simulated here as its file says: in .* random states a frame"):
        require_fidelity.__wrapped__(scene)
