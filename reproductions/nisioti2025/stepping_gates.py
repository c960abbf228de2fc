"""Figs. 3 and 4: conditions on the stepping gates, at the paper's size ("full") and scaled down ("smoke").

Hyperparameters are from the paper's tables (appendix A); training lengths, which it omits, are from the published code.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from evoclaims import Budget, Condition, Progression
from evoclaims.envs import Circuit, NParity, SimpleAlu
from evoclaims.methods import (
    CPPN_FUNCTIONS,
    CmaEs,
    HandBuilt,
    HyperNeat,
    HyperneatTensorneat,
    Method,
    Neat,
    NeatTensorneat,
    Ppo,
    RandomSearch,
)
from evoclaims.methods.neat import Attribute, Mutation, Settings, Species
from evoclaims.networks import AllSkips, Mlp

Conditions = dict[tuple[str, str], Condition]


def _on_every_task(
    parity: Circuit, alu: Circuit, method: Method[Any], parity_budget: Budget, alu_budget: Budget
) -> Conditions:
    """Return a method's conditions: N-parity and Simple ALU with the curriculum, and N-parity's last level alone."""
    on: list[tuple[str, Circuit, Progression, Budget]] = [
        ("n_parity", parity, "curriculum", parity_budget),
        ("simple_alu", alu, "curriculum", alu_budget),
        ("n_parity_direct", parity, "direct", parity_budget),
    ]
    return {(method.name, task): Condition(method, circuit, path, budget) for task, circuit, path, budget in on}


def _sampled(circuit: Any) -> Any:
    """Return the circuit for reinforcement learning: episodes of one random row (§3.1)."""
    return replace(circuit, sampling="sampled")


def _hand_built(parity: Circuit, alu: Circuit) -> Conditions:
    """Return conditions of the hand-built networks (control C2) on every level of both tasks; no training."""
    look = Budget(generations=1, reports=1)
    built = [_on_every_task(parity, alu, HandBuilt(negated=negated), look, look) for negated in (False, True)]
    return {**built[0], **built[1]}


def _tensorneat(parity: Circuit, alu: Circuit, neat: Settings, cppn: Settings, *budgets: Budget) -> Conditions:
    """Return conditions of both methods in the paper's library, to compare with ours; they need it installed."""
    on_parity, on_alu = budgets
    return {
        **_on_every_task(parity, alu, NeatTensorneat(neat), on_parity, on_alu),
        **_on_every_task(parity, alu, HyperneatTensorneat(cppn), on_parity, on_alu),
    }


def _full() -> Conditions:
    """Return the paper's own size."""
    parity, alu = NParity(bits=6), SimpleAlu()
    neat = Settings()  # the defaults are the paper's table
    cppn = replace(neat, activations=CPPN_FUNCTIONS)
    network = AllSkips(hidden=24)  # §A.3: "24 hidden neurons and all skip connections present"
    evolution = (Budget(generations=5_000), Budget(generations=10_000))
    learning = (Budget(environment_steps=150_000_000), Budget(environment_steps=450_000_000))
    return {
        **_on_every_task(parity, alu, CmaEs(population=256, network=network), *evolution),
        **_on_every_task(parity, alu, RandomSearch(population=256, network=network), *evolution),
        **_on_every_task(parity, alu, Neat(neat), *evolution),
        **_on_every_task(parity, alu, HyperNeat(cppn), *evolution),
        **_tensorneat(parity, alu, neat, cppn, *evolution),
        **_on_every_task(_sampled(parity), _sampled(alu), Ppo(), *learning),
        **_hand_built(parity, alu),
    }


def _smoke() -> Conditions:
    """Return the scaled-down instances (docs/smoke.md): 3-parity and the first two operations of the ALU.

    Random search solves 3-parity, so control C1 asks it and CMA-ES for 4-parity. Small populations for few generations
    need larger steps than the paper's: of NEAT's weights, and of PPO's networks, which also have more neurons.
    """
    parity, alu = NParity(bits=3), SimpleAlu(level_count=2)
    network = Mlp(layers=(8,) * 3)
    ppo = Ppo(policy_layers=(16,) * 3, environments=256, batch_size=256, minibatches=8, learning_rate=3e-3)
    mutation = Mutation(weight=Attribute(mutate_rate=0.5, power=0.5))
    small = Settings(population=256, nodes=12, connections=36, mutation=mutation, species=Species(most=10))
    large = replace(small, population=512, nodes=32, connections=96)
    cppn = replace(large, activations=CPPN_FUNCTIONS)
    steps, longer = Budget(environment_steps=100_000), Budget(environment_steps=400_000)
    generations = Budget(generations=400)
    conditions: Conditions = {}
    for method in (CmaEs, RandomSearch):
        solver, hard = (method(population=population, network=network) for population in (256, 4_096))
        conditions |= {
            (method.name, "n_parity"): Condition(solver, parity, "curriculum", generations),
            (method.name, "simple_alu"): Condition(hard, alu, "curriculum", Budget(generations=150)),
            (method.name, "n_parity_direct"): Condition(solver, NParity(bits=4), "direct", Budget(generations=500)),
        }
    neat = Budget(generations=3_000)
    return {
        **conditions,
        **_on_every_task(parity, alu, Neat(small), neat, neat),
        ("neat", "simple_alu"): Condition(Neat(large), alu, "curriculum", Budget(generations=1_500)),
        **_on_every_task(parity, alu, HyperNeat(cppn), generations, generations),
        **_tensorneat(parity, alu, small, cppn, generations, generations),
        **_on_every_task(_sampled(parity), _sampled(alu), ppo, steps, steps),
        ("ppo", "n_parity_direct"): Condition(ppo, _sampled(parity), "direct", longer),
        **_hand_built(parity, alu),
    }


FULL = _full()
SMOKE = _smoke()
