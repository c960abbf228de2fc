"""The line search of the constraints' solver: its straight lines lead to the root, and never beyond the start."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.typing import NDArray

from evoclaims.envs.ecorobot import constraints, physics
from evoclaims.envs.ecorobot.robot_task import RobotTask
from evoclaims.envs.ecorobot.robots import ANT
from evoclaims.envs.ecorobot.stones import SteppingStones
from evoclaims.kernels import in_numpy

Numbers = NDArray[np.float64]
Line = tuple[Numbers, ...]
"""Slope, curvature, stiffness, and how far rows are off and move, with a leading axis that counts lines."""
FRAMES, ROBOTS = 60, 100


def _slope(line: Line, t: Numbers) -> Numbers:
    slope, curvature, stiffness, off, along = line
    pushed: Numbers = np.sum(stiffness * along * np.minimum(0.0, off + t[:, None] * along), axis=1)
    return slope + t * curvature + pushed


def _cost(line: Line, t: Numbers) -> Numbers:
    slope, curvature, stiffness, off, along = line
    pushed: Numbers = np.sum(stiffness * np.minimum(0.0, off + t[:, None] * along) ** 2, axis=1)
    return slope * t + 0.5 * curvature * t**2 + 0.5 * pushed


def _exact(line: Line) -> Numbers:
    """Return where the slope is 0: it rises, so that is behind the last bend at which it is below, on its line."""
    _, curvature, stiffness, off, along = line
    bends = np.where(along != 0, -off / np.where(along != 0, along, 1.0), 0.0)
    before = np.zeros(len(off))
    for column in bends.T:
        here = np.where(column > 0, column, 0.0)
        before = np.where((_slope(line, here) < 0) & (here > before), here, before)
    after = np.full(len(off), np.inf)
    for column in bends.T:
        after = np.where((column > before) & (column < after), column, after)
    inside = np.where(np.isinf(after), before + 1.0, (before + after) / 2)
    pushes = off + inside[:, None] * along < 0
    rise = curvature + np.sum(np.where(pushes, stiffness * along**2, 0.0), axis=1)
    root: Numbers = before - _slope(line, before) / rise
    return root


def _random_lines(count: int, rows: int, velocities: int) -> Line:
    """Return the lines along which random problems' first steps go."""
    random = np.random.default_rng(rows)
    lines = []
    for _ in range(count):
        root, jacobian = random.normal(size=(velocities, velocities)), random.normal(size=(rows, velocities))
        mass = root @ root.T + np.diag(10.0 ** random.uniform(-2, 1, velocities))
        stiffness = 10.0 ** random.uniform(0, 5, rows)
        free, start = (random.normal(size=velocities) * 10.0 ** random.uniform(-1, 2) for _ in range(2))
        off = jacobian @ start - random.normal(size=rows)
        active = np.where(off < 0, stiffness, 0.0)
        gradient = mass @ (start - free) + jacobian.T @ (active * off)
        search = -np.linalg.solve(mass + jacobian.T @ (active[:, None] * jacobian), gradient)
        lines.append((search @ mass @ (start - free), search @ mass @ search, stiffness, off, jacobian @ search))
    return tuple(np.array(column) for column in zip(*lines, strict=True))


def _roots(line: Line, pieces: int, monkeypatch: pytest.MonkeyPatch) -> Numbers:
    monkeypatch.setattr(constraints, "PIECES", pieces)
    with jax.enable_x64(True):
        (found,) = in_numpy(lambda *given: constraints._root(*given), *line)
    return np.asarray(found)


@pytest.mark.parametrize("rows", [4, 12, 40])
def test_straight_lines_lead_to_the_root(rows: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each is nearer than those before on its side: what pushes between two places does at one of them."""
    line = _random_lines(2_000, rows, 5)
    exact = _exact(line)
    size = np.abs(line[0]) + np.sum(line[2] * np.abs(line[4] * line[3]), axis=1)
    assert np.max(np.abs(_slope(line, exact)) / size) < 1e-9
    low, high = np.zeros(len(exact)), np.full(len(exact), np.inf)
    for pieces in range(1, 8):
        t = _roots(line, pieces, monkeypatch)
        near = np.abs(t - exact) < 1e-9 * exact
        assert np.all(near | ((t > low) & (t < high)))
        low, high = np.where(t < exact, t, low), np.where(t > exact, t, high)
    np.testing.assert_allclose(_roots(line, 20, monkeypatch), exact, rtol=1e-9)


@pytest.mark.parametrize("rows", [4, 12, 40])
def test_a_search_that_ends_early_costs_less_than_the_start(rows: int, monkeypatch: pytest.MonkeyPatch) -> None:
    line = _random_lines(2_000, rows, 5)
    t, exact, start = _roots(line, constraints.PIECES, monkeypatch), _exact(line), np.zeros(len(line[0]))
    gain = _cost(line, start) - _cost(line, exact)
    assert np.all(_cost(line, t) - _cost(line, exact) <= 0.1 * gain)
    assert np.mean(np.abs(t - exact) < 1e-9 * exact) > 0.995


def _recorded(task: RobotTask) -> tuple[Line, Numbers]:
    """Return the lines, and the roots that were found along episodes, of frames where something pushes at first."""
    scene, random = task.scene, np.random.default_rng(0)
    held: list[Any] = []

    def searched(*line: Any) -> Any:
        held[:] = [*line, found(*line)]
        return held[-1]

    found = constraints._root

    def frame(*state: Any) -> Any:
        body = physics._frame.__wrapped__(scene, physics.Body(*state[:3]), state[3], scene.turns)  # type: ignore[attr-defined]
        return body.position, body.velocity, body.acceleration, *held

    state = jax.vmap(task.reset, (0, None))(jax.random.split(jax.random.key(0), ROBOTS), jnp.int32(0))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(constraints, "_root", searched)
        body = state.inner.body
        traced = jax.jit(jax.vmap(frame), compiler_options={"xla_backend_optimization_level": 0})
        bodies: Any = (body.position, body.velocity, body.acceleration)
        rows = []
        for at in range(FRAMES):
            if at % 10 == 0:
                control = random.uniform(-1.0, 1.0, (ROBOTS, task.action_size)).astype(np.float32)
            made = traced(*bodies, control)
            bodies = made[:3]
            rows.append([np.asarray(x, np.float64) for x in made[3:]])
    line = tuple(np.concatenate(column) for column in zip(*rows, strict=True))
    pushes = np.any((line[2] > 0) & (line[3] < 0), axis=1)
    return tuple(column[pushes] for column in line[:5]), line[5][pushes]


@pytest.mark.slow
def test_along_episodes_of_ants_five_straight_lines_reach_the_root() -> None:
    line, found = _recorded(SteppingStones(robot=ANT))
    exact = _exact(line)
    assert len(found) >= 2_000
    assert np.mean(np.abs(exact - 1.0) > 1e-2) > 0.02  # rows turn along these lines
    off = np.abs(found - exact) > 1e-4 * exact
    assert off.sum() <= len(found) / 10_000
