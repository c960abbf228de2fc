"""The obstacles of the published code, and the variants that run on them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from evoclaims.envs import Box, Obstacles, RobotTask, Surface
from evoclaims.envs.base import Episode
from evoclaims.envs.ecorobot.pose import Pose
from evoclaims.envs.ecorobot.robots import HALF_CHEETAH
from evoclaims.envs.ecorobot.scene import Scene, box_geoms
from evoclaims.methods import Ppo
from reproductions.nisioti2025 import REPRODUCTION
from reproductions.nisioti2025.published_course import SURFACE, PublishedObstacles, published_boxes

PUBLISHED, OURS = PublishedObstacles(), Obstacles()


def test_published_obstacles_have_our_places_and_tops_and_reach_as_deep_as_high() -> None:
    model = PUBLISHED.scene.whole
    geoms = box_geoms(model)
    height = np.repeat([0.1, 0.2, 0.3], 5)
    assert np.allclose(model.geom_size[geoms], [(0.2, 3.0, half) for half in height])
    assert np.allclose(model.geom_pos[geoms, 2], 0.0)
    assert np.array_equal(model.geom_pos[geoms, 0], OURS.scene.whole.geom_pos[geoms, 0])


def test_the_simulated_boxes_are_as_rough_and_hard_as_the_published_ones_and_ours_as_mujocos() -> None:
    for task, friction, solref, solimp in (
        (PUBLISHED, (2.0, 0.1, 0.1), (0.01, 1.0), (0.99, 0.99, 0.01, 0.5, 2.0)),
        (OURS, (1.0, 0.005, 0.0001), (0.02, 1.0), (0.9, 0.95, 0.001, 0.5, 2.0)),
    ):
        model = task.scene.model
        geoms = box_geoms(model)
        assert np.allclose(model.geom_friction[geoms], friction)
        assert np.allclose(model.geom_solref[geoms], solref)
        assert np.allclose(model.geom_solimp[geoms], solimp)


@pytest.mark.parametrize("flat", [False, True])
@pytest.mark.parametrize("surface", [Surface(), SURFACE])
def test_depth_and_surface_are_changed_apart_and_nothing_else(flat: bool, surface: Surface) -> None:
    for ours, made in zip(OURS.boxes, published_boxes(OURS.boxes, flat=flat, surface=surface), strict=True):
        assert (made.bottom == -made.top) == flat
        assert made.surface == surface
        assert replace(made, bottom=ours.bottom, surface=ours.surface) == ours


def test_boxes_of_different_surfaces_do_not_take_turns() -> None:
    row = PUBLISHED.boxes
    assert Scene(HALF_CHEETAH, row).near < len(row)
    mixed = (*row[:-1], Box(row[-1].centre, row[-1].half_size, surface=Surface()))
    assert Scene(HALF_CHEETAH, mixed).near == len(row)


@pytest.mark.parametrize(("task", "cost"), [(PUBLISHED, 0.0), (OURS, 0.6)])
def test_a_published_step_pays_the_distance_alone(task: Obstacles, cost: float) -> None:
    def at(x: float) -> Pose:
        return Pose(place=jnp.array([x, 0.0, 0.6]), rotation=jnp.eye(3))

    ruling = task.rule(task.memory(at(1.0)), at(1.0), at(1.1), jnp.array([1.0, -1.0] * 3))
    assert float(ruling.reward) == pytest.approx(0.1 / 0.05 - cost, rel=1e-4)


@pytest.mark.parametrize(("task", "steps"), [(PublishedObstacles(episode_steps=100), 200), (OURS, 1_000)])
def test_published_policies_are_examined_for_twice_the_steps(
    task: Obstacles, steps: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def length(self: RobotTask, *_: Any, **__: Any) -> Episode:
        return Episode(fitness=jnp.float32(self.horizon), success=jnp.float32(0.0))

    monkeypatch.setattr(RobotTask, "_play", length)
    examined = task.examine(lambda observation: observation, jax.random.key(0), jnp.int32(0))
    assert int(examined.fitness) == steps


@pytest.mark.parametrize("tier", ["smoke", "full"])
def test_the_variant_changes_obstacles_of_every_height_and_nothing_else(tier: str) -> None:
    plain = REPRODUCTION.tier(tier).conditions
    changed = REPRODUCTION.variants["published_course"].conditions[tier]
    assert set(changed) == {names for names, c in plain.items() if isinstance(c.task, Obstacles)}
    for names, condition in changed.items():
        before: Any = plain[names].task
        assert condition.method == plain[names].method
        assert condition.task == PublishedObstacles(episode_steps=before.episode_steps, heights=before.heights)


def test_few_environments_are_the_published_128_with_batches_of_512() -> None:
    changed = REPRODUCTION.variants["few_environments"].conditions["full"]
    assert {names[1] for names in changed} >= {"obstacles", "stones", "locomotion_ant"}
    for condition in changed.values():
        learner: Any = condition.method
        assert isinstance(learner, Ppo)
        assert (learner.environments, learner.batch_size) == (128, 512)
