"""A project whose five conditions each rest on another library, as small as they can be with the real methods."""

from __future__ import annotations

from typing import Final

PYPROJECT: Final = """
[tool.evoclaims]
reproduction = "laboratory"

[tool.pytest.ini_options]
testpaths = ["claims"]
"""

LABORATORY: Final = '''
"""CMA-ES of evosax, PPO of brax, flax and optax, MAP-Elites of qdax, a hinge of mujoco-mjx, and a net of none."""
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import ClassVar

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from evoclaims.envs.base import Episode, TaskState
from evoclaims.envs.gates.parity import NParity
from evoclaims.judging.design import Design
from evoclaims.methods.cma_es import CmaEs
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.methods.map_elites import MapElites
from evoclaims.methods.ppo import Ppo
from evoclaims.methods.random_policy import RandomPolicy
from evoclaims.networks.mlp import Mlp
from evoclaims.paper.reproduction import Reproduction, Tier
from evoclaims.trials.spec import Budget
from evoclaims.trials.spec import Condition

HINGE = """<mujoco><worldbody><body><joint name="hinge" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 1 0 0" size="0.1"/></body></worldbody></mujoco>"""


@dataclass(frozen=True)
class Plane:
    """One step from the origin, to where the policy says; the target is far up and to the right."""

    name: ClassVar[str] = "plane"
    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ()
    levels: ClassVar[int] = 1
    observation_size: ClassVar[int] = 2
    action_size: ClassVar[int] = 2
    horizon: ClassVar[int] = 1
    area: ClassVar = ((-1.0, 1.0), (-1.0, 1.0))

    def reachable(self, cells):
        return np.ones(cells, bool)

    def reset(self, key, level):
        return TaskState(jnp.ones((2,)), jnp.zeros(()), jnp.zeros((), bool), jnp.zeros((), bool), ())

    def step(self, state, action):
        return state

    def episode(self, policy, key, level):
        x, y = jnp.tanh(policy(jnp.ones((2,))))
        return Episode(x + y, (x + y > 1.5).astype(jnp.float32), {"x": x, "y": y, "reached": jnp.zeros(())})

    examine = episode


@lru_cache
def hinge():
    with jax.ensure_compile_time_eval():
        return mjx.put_model(mujoco.MjModel.from_xml_string(HINGE))


@dataclass(frozen=True)
class Swing:
    """A rod on a hinge, which a policy turns: the higher its middle, the better."""

    name: ClassVar[str] = "swing"
    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ("mujoco", "mujoco-mjx")
    levels: ClassVar[int] = 1
    observation_size: ClassVar[int] = 2
    action_size: ClassVar[int] = 1
    horizon: ClassVar[int] = 1

    def reset(self, key, level):
        return TaskState(jnp.ones((2,)), jnp.zeros(()), jnp.zeros((), bool), jnp.zeros((), bool), ())

    def step(self, state, action):
        return state

    def episode(self, policy, key, level):
        model = hinge()
        angle = jax.random.uniform(key, (1,)) + policy(jnp.ones((2,)))
        with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
            height = mjx.kinematics(model, mjx.make_data(model).replace(qpos=angle)).geom_xpos[0, 2]
        return Episode(height, (height > 0).astype(jnp.float32), {})

    examine = episode


def condition(method, task, steps):
    return Condition(method, task, "whole_budget", Budget(generations=steps, reports=1))


TINY_PPO = Ppo(
    policy_layers=(4,), value_layers=(4,), environments=8, batch_size=8, minibatches=1, updates_per_batch=2,
    learning_rate=0.03,
)
CONDITIONS = {
    ("cma_es", "parity"): condition(CmaEs(population=32, network=Mlp((8,))), NParity(2), 100),
    ("ppo", "parity"): condition(TINY_PPO, NParity(2), 4),
    ("map_elites", "plane"): condition(
        MapElites(network=Mlp((2,)), batch=4, cells=(4, 4), iso_sigma=0.2, line_sigma=0.2, initial=4), Plane(), 4
    ),
    ("random", "swing"): condition(RandomPolicy(network=Mlp((2,))), Swing(), 1),
    ("hand_built", "parity"): condition(HandBuilt(), NParity(2), 1),
}
REPRODUCTION = Reproduction(
    name="laboratory",
    title="A Small Laboratory",
    folder=Path(__file__).parent,
    tiers={"smoke": Tier(CONDITIONS, Design.fixed(10)), "full": Tier(CONDITIONS, Design.fixed(10))},
)
'''

CLAIMS: Final = """
import pytest
from evoclaims import claim, expected, Outcome
from laboratory import CONDITIONS


@claim("L1", says="It solves its task", where="§1", smoke="It solves its task in small")
@pytest.mark.parametrize("names", CONDITIONS, ids="_on_".join)
def test_it_solves_its_task(names, trials, verdict):
    method, task = names
    verdict(trials(method, on=task).solves_every_level.in_most_trials(p0=0.5))
"""
