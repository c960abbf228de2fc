"""The methods that every conformance test runs over; a new method is one entry here."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import jax
import pytest
from workbench import Workbench

from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.cma_es import CmaEs
from evoclaims.methods.hyperneat import CPPN_FUNCTIONS, HyperNeat
from evoclaims.methods.neat.neat import Neat
from evoclaims.methods.neat.settings import Attribute, Mutation, Settings, Species
from evoclaims.methods.ppo import Ppo
from evoclaims.methods.random_search import RandomSearch
from evoclaims.networks.all_skips import AllSkips


@dataclass(frozen=True)
class Entry:
    """A method small enough to compile and run in no time.

    Attributes:
        method: the method.
        task: what the conformance tests train it on.
        cost: environment steps of one of its steps on `task`, worked out by hand.
        keeps_the_best: whether its best policy never gets worse on a deterministic task.
        prober: the method at a size that solves every probe.
        curriculum: steps that the probe with two levels may take.
    """

    method: Any
    task: Any
    cost: int
    keeps_the_best: bool
    prober: Any
    curriculum: int


SMALL = Settings(population=24, nodes=12, connections=36, species=Species(most=3))
# Large steps, many parents and few deletions: the last probe's second level is an exclusive or, which the paper's
# values solve rarely at this size.
LARGE_STEPS = Attribute(mutate_rate=0.6, power=0.5)
PROBING = Settings(
    population=150,
    nodes=12,
    connections=36,
    mutation=Mutation(weight=LARGE_STEPS, bias=LARGE_STEPS, node_delete=0.05, connection_delete=0.1),
    species=Species(most=5, survival=0.2),
)

METHODS = {
    "random_search": Entry(
        method=RandomSearch(12, network=AllSkips(3)),
        task=NParity(3),
        cost=12 * 8,
        keeps_the_best=True,
        prober=RandomSearch(256, network=AllSkips(8)),
        curriculum=200,
    ),
    "cma_es": Entry(
        method=CmaEs(12, network=AllSkips(3)),
        task=NParity(3),
        cost=12 * 8,
        keeps_the_best=True,
        prober=CmaEs(256, network=AllSkips(8)),
        curriculum=200,
    ),
    "neat": Entry(
        method=Neat(SMALL),
        task=NParity(3),
        cost=24 * 8,
        keeps_the_best=True,
        prober=Neat(PROBING),
        curriculum=3000,
    ),
    "hyperneat": Entry(
        method=HyperNeat(replace(SMALL, activations=CPPN_FUNCTIONS), hidden=(4,)),
        task=NParity(3),
        cost=24 * 8,
        keeps_the_best=True,
        prober=HyperNeat(replace(PROBING, activations=CPPN_FUNCTIONS), hidden=(8,), extent="unit"),
        curriculum=3000,
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
        prober=Ppo(
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
}
_BENCHES = {name: Workbench(entry.method, entry.task) for name, entry in METHODS.items()}


@pytest.fixture(autouse=True)
def _strictly() -> Iterator[None]:
    """Run every test without implicit promotions and with every key used once."""
    with jax.numpy_dtype_promotion("strict"), jax.numpy_rank_promotion("raise"), jax.debug_key_reuse(True):
        yield


@pytest.fixture(params=METHODS)
def name(request: pytest.FixtureRequest) -> str:
    """Each method's name in turn."""
    return str(request.param)


@pytest.fixture
def entry(name: str) -> Entry:
    """The method's entry in the table."""
    return METHODS[name]


@pytest.fixture
def bench(name: str) -> Workbench:
    """The method with its compiled step, which the tests share."""
    return _BENCHES[name]


@pytest.fixture
def cpus() -> list[Any]:
    """The CPU device that the engine runs trials on: one compiles faster than two."""
    return list(jax.devices("cpu")[:1])


@pytest.fixture
def probers() -> dict[str, Any]:
    """Every method at the size that solves probes."""
    return {name: entry.prober for name, entry in METHODS.items()}


@pytest.fixture
def benches() -> dict[str, Workbench]:
    """Every method with its compiled step."""
    return _BENCHES
