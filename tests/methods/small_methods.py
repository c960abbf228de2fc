"""Every method at a size that compiles and runs in no time, for the conformance tests; a new one is one entry here."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from plane import Plane
from workbench import Workbench

from evoclaims.envs.ecorobot.stones import SteppingStones
from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.cma_es import CmaEs, SeldomDecomposedCmaEs
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.methods.hyperneat import CPPN_FUNCTIONS, HyperNeat
from evoclaims.methods.hyperneat_tensorneat import HyperneatTensorneat
from evoclaims.methods.map_elites import MapElites
from evoclaims.methods.neat.evolution import Neat
from evoclaims.methods.neat.settings import Attribute, Mutation, Settings, Species
from evoclaims.methods.ppo import Ppo
from evoclaims.methods.random_policy import RandomPolicy
from evoclaims.methods.random_search import RandomSearch
from evoclaims.methods.tensorneat import NeatTensorneat
from evoclaims.networks.all_skips import AllSkips
from evoclaims.networks.mlp import Mlp
from reproductions.nisioti2025.waypoints import Waypoints


@dataclass(frozen=True)
class Entry:
    """A method small enough to compile and run in no time.

    Attributes:
        method: the method.
        task: what the conformance tests train it on.
        cost: environment steps of one of its steps on `task`, worked out by hand.
        other: the method with other hyperparameters: at a size that solves every probe, if it is one that does.
        curriculum: steps that the probe with two levels may take; 0 for a method that no probe is for, and for one that
            climbs by another's code.
        selection: steps that the probe of selection may take; 0 for a method that breeds none of its policies.
        keeps_the_best: whether its best policy never gets worse on a deterministic task.
        learns: whether a step draws from its key and changes the numbers that the method goes on with.
        examines: whether a step reports what its policy does.
        sees_rewards: whether it learns from single rewards, and not from the fitness of whole episodes alone.
        needs: a package that is no dependency.
    """

    method: Any
    task: Any
    cost: int
    other: Any
    curriculum: int = 0
    selection: int = 0
    keeps_the_best: bool = True
    learns: bool = True
    examines: bool = True
    sees_rewards: bool = False
    needs: str | None = None


SMALL = Settings(population=24, nodes=12, connections=36, species=Species(most=3))
# Large steps, many parents and few deletions: the last probe's second level is an exclusive or, which the paper's
# values solve rarely at this size.
LARGE_STEPS = Attribute(mutate_rate=0.6, power=0.5)
PROBING = Settings(
    population=150,
    nodes=24,
    connections=72,
    mutation=Mutation(weight=LARGE_STEPS, bias=LARGE_STEPS, node_delete=0.05, connection_delete=0.1),
    species=Species(most=5, survival=0.2),
)

METHODS = {
    "random_search": Entry(
        method=RandomSearch(12, network=AllSkips(3)),
        task=NParity(3),
        cost=12 * 8,
        other=RandomSearch(256, network=AllSkips(8)),
        curriculum=200,
    ),
    "cma_es": Entry(
        method=CmaEs(12, network=AllSkips(3)),
        task=NParity(3),
        cost=12 * 8,
        other=CmaEs(256, network=AllSkips(8)),
        curriculum=200,
        selection=40,
    ),
    "seldom_decomposed_cma_es": Entry(
        method=SeldomDecomposedCmaEs(12, network=AllSkips(3)),
        task=NParity(3),
        cost=12 * 8,
        other=SeldomDecomposedCmaEs(256, network=AllSkips(8), replaced=0.1),
        selection=40,
    ),
    "neat": Entry(method=Neat(SMALL), task=NParity(3), cost=24 * 8, other=Neat(PROBING), curriculum=3000, selection=30),
    "hyperneat": Entry(
        method=HyperNeat(replace(SMALL, activations=CPPN_FUNCTIONS), hidden=(4,)),
        task=NParity(3),
        cost=24 * 8,
        other=HyperNeat(replace(PROBING, activations=CPPN_FUNCTIONS), hidden=(8,), extent="unit"),
        selection=300,
    ),
    "ppo": Entry(
        method=Ppo(
            policy_layers=(4,),
            value_layers=(4,),
            environments=8,
            unroll_length=2,
            batch_size=8,
            minibatches=2,
            updates_per_batch=2,
            normalize_observations=True,
        ),
        task=NParity(3, "sampled"),
        cost=8 * 2 * 2,
        keeps_the_best=False,
        sees_rewards=True,
        other=Ppo(
            policy_layers=(16,),
            value_layers=(16,),
            environments=64,
            unroll_length=2,
            batch_size=32,
            minibatches=4,
            learning_rate=1e-2,
        ),
        curriculum=2000,
    ),
    "map_elites": Entry(
        method=MapElites(network=Mlp((4,)), batch=8, cells=(4, 3), iso_sigma=0.2, line_sigma=0.2, initial=8),
        task=Plane(stride=0.2),
        cost=8 * 5,
        other=MapElites(),
    ),
    "random_policy": Entry(
        method=RandomPolicy(AllSkips(3)),
        task=NParity(3),
        cost=8,
        other=RandomPolicy(),
        keeps_the_best=False,
        learns=False,
    ),
    "hand_built": Entry(
        method=HandBuilt(), task=NParity(3), cost=8, other=HandBuilt(negated=True), keeps_the_best=False, learns=False
    ),
    "waypoints": Entry(
        method=Waypoints(),
        task=SteppingStones(shows_goal=True, episode_steps=20),
        cost=20,
        other=Waypoints(speed=0.5),
        keeps_the_best=False,
        learns=False,
        examines=False,
    ),
    "neat_tensorneat": Entry(
        method=NeatTensorneat(SMALL), task=NParity(3), cost=24 * 8, other=NeatTensorneat(PROBING), needs="tensorneat"
    ),
    "hyperneat_tensorneat": Entry(
        method=HyperneatTensorneat(replace(SMALL, activations=CPPN_FUNCTIONS), hidden=(4,)),
        task=NParity(3),
        cost=24 * 8,
        other=HyperneatTensorneat(),
        needs="tensorneat",
    ),
}
BENCHES = {name: Workbench(entry.method, entry.task) for name, entry in METHODS.items()}
"""Each method with its compiled step, which the tests share."""
