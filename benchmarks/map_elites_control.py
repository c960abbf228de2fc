"""Does MAP-Elites reach the target of the difficult deceptive maze? A control on a reduced budget, seed by seed.

`python benchmarks/map_elites_control.py --seeds 4 5` takes a few minutes a seed on one core. The paper's budget is
100,000 policies in episodes of 1,000 steps, kept in 50 x 50 cells; here it is 64,000 at most, of 400 steps, in 16 x 14.
Simulated robots are chaotic: how soon a seed gets there depends on the machine's rounding.
"""

from __future__ import annotations

import argparse
import time
from functools import partial

import jax
import jax.numpy as jnp

from evoclaims.envs.ecorobot.deceptive import DeceptiveMaze
from evoclaims.methods.map_elites import MapElites, MapElitesState
from evoclaims.networks.mlp import Mlp
from evoclaims.trials.devices import MATMUL_PRECISION, configure

TASK = DeceptiveMaze(difficulty="difficult", episode_steps=400)
METHOD = MapElites(network=Mlp((16,)), batch=64, initial=128, cells=(16, 14), iso_sigma=0.5, line_sigma=0.3)
AT_ONCE, MOST = 20, 1_000
"""Iterations in one program, and at most."""


@jax.jit
def _grow(key: jax.Array, first: jax.Array, state: MapElitesState) -> tuple[MapElitesState, jax.Array]:
    """Return the state after `AT_ONCE` more iterations, and the coverage."""

    def iteration(state: MapElitesState, index: jax.Array) -> tuple[MapElitesState, jax.Array]:
        step = partial(METHOD.step, jax.random.fold_in(key, index), TASK, jnp.zeros((), jnp.int32))
        state, progress = step(state)
        return state, progress.metrics["coverage"]

    state, coverage = jax.lax.scan(iteration, state, first + jnp.arange(AT_ONCE))
    return state, coverage[-1]


def main() -> None:
    """Run each seed until an individual has reached the target."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="*", default=[4, 5])
    configure()
    for seed in parser.parse_args().seeds:
        began, state = time.perf_counter(), METHOD.init(jax.random.key(seed), TASK)
        for done in range(AT_ONCE, MOST + 1, AT_ONCE):
            with jax.default_matmul_precision(MATMUL_PRECISION):
                state, coverage = _grow(jax.random.key(seed), jnp.asarray(done - AT_ONCE), state)
            if float(state.reached) == 1:
                break
        found = "reached" if float(state.reached) == 1 else "not reached"
        print(
            f"seed {seed}: the target was {found} after {int(state.evaluated):,} policies; "
            f"{float(coverage):.0%} of the maze covered; {time.perf_counter() - began:.0f} s",
            flush=True,
        )


if __name__ == "__main__":
    main()
