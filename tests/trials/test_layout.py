"""How programs are compiled: what XLA is told of a condition's."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import pytest
from jax.errors import JaxRuntimeError

from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.neat.evolution import Neat
from evoclaims.methods.neat.settings import Settings
from evoclaims.trials.layout import BRIEF, FAST_TO_COMPILE, LOOPS_ON_GPU, SHORT, SIDE_BY_SIDE, Layout
from evoclaims.trials.spec import Budget, Condition
from reproductions.nisioti2025 import REPRODUCTION


def _condition(population: int, generations: int) -> Condition:
    return Condition(Neat(Settings(population=population)), NParity(bits=6), "direct", Budget(generations=generations))


@pytest.mark.parametrize("options", [FAST_TO_COMPILE, LOOPS_ON_GPU, SIDE_BY_SIDE])
def test_xla_knows_all_options(options: dict[str, object]) -> None:
    lowered = jax.jit(jnp.sin).lower(1.0)
    assert lowered.compile(options)(1.0) == jnp.sin(1.0)
    (name,) = options if len(options) == 1 else ("xla_llvm_disable_expensive_passes",)
    with pytest.raises((JaxRuntimeError, ValueError), match=name):
        lowered.compile({name: "nonsense"})


def test_a_gpu_reads_conditions_itself_where_a_step_of_neat_is_brief_and_kernels_run_together_elsewhere() -> None:
    options = [Layout.VECTOR.options(_condition(population, 1)) for population in (1_024, 1_562, 1_563, 5_000)]
    assert options == [LOOPS_ON_GPU, LOOPS_ON_GPU, SIDE_BY_SIDE, SIDE_BY_SIDE]  # of 64 environment steps each
    ppo = REPRODUCTION.tiers["full"].conditions["ppo", "n_parity"]
    assert ppo.cost < BRIEF
    assert Layout.VECTOR.options(ppo) == SIDE_BY_SIDE  # a step has many loops, and takes 0.6 of the time so


def test_a_short_trial_on_a_processor_is_compiled_fast() -> None:
    generations = SHORT // (100 * 64)
    assert Layout.ALONE.options(_condition(100, generations)) == FAST_TO_COMPILE
    assert Layout.ALONE.options(_condition(100, generations + 1)) is None
