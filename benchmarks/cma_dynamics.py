"""Our CMA-ES against the package `cma`, and against random search: what is solved, on the same tasks and budgets?

    pip install cma==4.5.0
    python benchmarks/cma_dynamics.py parity3 --seeds 40 [--side ours|ours-damped|cma|cma-published|random] [--out FILE]

parity3 and parity4: three and four of N-parity's four bits, asked from the first generation on; parity: two, three and
four bits after one another; alu2 and alu: the first two, or three, operations of Simple ALU after one another. Every
side trains `AllSkips(16)` for at most 300 generations of 256 from a mean of 0 and a step size of 1. The sides:

ours: `CmaEs`, which breaks ties by index.
ours-damped: the same with the damping of the step size that cma has had since 4.4.4, here twice Hansen's (2016).
cma: the package's defaults, with ties broken at random and without its criteria for stopping. From 300 parameters on
(Simple ALU's network has 364) these replace Hansen's path of the step size by a two-point rule.
cma-published: the same with Hansen's path for any number of parameters, and his damping, which cma had up to 4.4.0.
random: `RandomSearch`.

Runs are kept in the file as they end; the same call again goes on. All runs in it are compared by exact two-sided
tests: Fisher's of how many solved their task, and ranks of the generation that did.
"""

from __future__ import annotations

import argparse
import json
import statistics
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

from evoclaims.trials import devices

devices.configure()

import jax  # noqa: E402
import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402
from scipy.stats import fisher_exact  # noqa: E402

from evoclaims.core.files import write_atomically  # noqa: E402
from evoclaims.core.keys import streams  # noqa: E402
from evoclaims.envs.gates.alu import SimpleAlu  # noqa: E402
from evoclaims.envs.gates.circuit import Circuit  # noqa: E402
from evoclaims.envs.gates.parity import NParity  # noqa: E402
from evoclaims.judging.exact import rank_test  # noqa: E402
from evoclaims.methods.cma_es import CmaEs  # noqa: E402
from evoclaims.methods.flat_champion import evaluate  # noqa: E402
from evoclaims.methods.random_search import RandomSearch  # noqa: E402
from evoclaims.networks.all_skips import AllSkips  # noqa: E402

GENERATIONS, POPULATION, NETWORK = 300, 256, AllSkips(16)
TASKS: dict[str, tuple[Circuit, tuple[int, ...]]] = {
    "parity3": (NParity(bits=4), (1,)),
    "parity4": (NParity(bits=4), (2,)),
    "parity": (NParity(bits=4), (0, 1, 2)),
    "alu2": (SimpleAlu(level_count=3), (0, 1)),
    "alu": (SimpleAlu(level_count=3), (0, 1, 2)),
}
Climber = Callable[[int, int], float]
"""(level, generation) -> the best success in that generation."""


def damping(n: int, mu_eff: Any, c_sigma: Any, inner: float) -> jax.Array:
    """Return d_σ: Hansen's Eq. (55) for inner = 1; cma 4.5.0's for its inner = 3 (1 in few dimensions)."""
    return 1 + 2 * jnp.maximum(0, inner * jnp.sqrt((mu_eff - 1) / (n + 1)) - 1) + c_sigma


@dataclass(frozen=True)
class Damped(CmaEs):
    """CMA-ES with cma 4.5.0's damping of the step size."""

    def _search(self, task: Any) -> tuple[Any, Any]:
        search, params = super()._search(task)
        n = self.network.size(task.observation_size, task.action_size)
        inner = max(1, 3 * (1 - 0.5 ** (n / 9)))
        return search, params.replace(d_std=damping(n, params.mu_eff, params.c_std, inner))


def by_method(method: Any, task: Circuit, seed: int) -> Climber:
    """Run a method of ours."""
    start, steps = streams(jax.random.key(seed), "start", "steps")
    state = method.init(start, task)
    step = _compiled_step(method, task)

    def climb(level: int, generation: int) -> float:
        nonlocal state
        state, progress = step(jax.random.fold_in(steps, generation), jnp.int32(level), state)
        return float(progress.success)

    return climb


def by_cma(published: bool, task: Circuit, seed: int) -> Climber:
    """Run the package `cma`."""
    import cma

    n = NETWORK.size(task.observation_size, task.action_size)
    options: dict[str, Any] = {"popsize": POPULATION, "seed": seed + 1, "verbose": -9, "tolflatfitness": 10**9}
    if published:
        options["AdaptSigma"] = cma.sigma_adaptation.CMAAdaptSigmaCSA
    search = cma.CMAEvolutionStrategy(np.zeros(n), 1.0, options)
    if published:
        search.adapt_sigma.initialize(search)
        search.adapt_sigma.damps = float(damping(n, search.sp.weights.mueff, search.adapt_sigma.cs, inner=1))
    ties, judge = np.random.default_rng(seed), _compiled_evaluation(task)

    def climb(level: int, _: int) -> float:
        population = search.ask()
        episodes = judge(jnp.int32(level), jnp.asarray(np.array(population), jnp.float32))
        ranks = np.empty(POPULATION)
        ranks[np.lexsort((ties.random(POPULATION), -np.asarray(episodes.fitness)))] = np.arange(POPULATION)
        search.tell(population, list(ranks))
        return float(episodes.success.max())

    return climb


SIDES: dict[str, Callable[[Circuit, int], Climber]] = {
    "ours": lambda task, seed: by_method(CmaEs(POPULATION, NETWORK), task, seed),
    "ours-damped": lambda task, seed: by_method(Damped(POPULATION, NETWORK), task, seed),
    "cma": lambda task, seed: by_cma(False, task, seed),
    "cma-published": lambda task, seed: by_cma(True, task, seed),
    "random": lambda task, seed: by_method(RandomSearch(POPULATION, 1.0, NETWORK), task, seed),
}
_steps: dict[Any, Any] = {}


def _compiled_step(method: Any, task: Circuit) -> Any:
    if (method, task) not in _steps:
        _steps[method, task] = jax.jit(lambda key, level, state: method.step(key, task, level, state))
    return _steps[method, task]


def _compiled_evaluation(task: Circuit) -> Any:
    if task not in _steps:
        key = jax.random.key(0)  # whole tables have no randomness
        _steps[task] = jax.jit(lambda level, population: evaluate(NETWORK, task, key, level, population))
    return _steps[task]


def solved_at(climb: Climber, levels: tuple[int, ...]) -> int | None:
    """Return the generation that solved the last level; None when none did."""
    ahead: Iterator[int] = iter(levels)
    level = next(ahead)
    for generation in range(GENERATIONS):
        if climb(level, generation) == 1.0:
            following = next(ahead, None)
            if following is None:
                return generation + 1
            level = following
    return None


def tell(runs: dict[str, dict[str, int | None]]) -> None:
    """Print what each side solved, and compare all pairs of sides on one task."""
    never = GENERATIONS + 1
    for name, by_seed in sorted(runs.items()):
        solved = [generation for generation in by_seed.values() if generation is not None]
        middle = statistics.median_low([generation or never for generation in by_seed.values()])
        print(f"{name:<24} {len(solved)} of {len(by_seed)}, median {'never' if middle == never else middle}")
    for one, other in combinations(sorted(runs), 2):
        if one.split()[0] == other.split()[0]:
            a, b = ([-(generation or never) for generation in runs[side].values()] for side in (one, other))
            table = [[len(side) - side.count(-never), side.count(-never)] for side in (a, b)]
            ranks = min(1.0, 2 * min(rank_test(a, b).p, rank_test(b, a).p))
            print(f"{one} against {other.split()[1]}: Fisher p = {fisher_exact(table)[1]:.2g}, ranks p = {ranks:.2g}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("task", choices=TASKS)
    parser.add_argument("--side", choices=SIDES, action="append", help="run this side only (may be repeated)")
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--out", type=Path, default=Path("cma-dynamics.json"))
    options = parser.parse_args()
    task, levels = TASKS[options.task]
    runs = json.loads(options.out.read_text()) if options.out.exists() else {}
    for seed in range(options.seeds):
        for side in options.side or SIDES:
            done = runs.setdefault(f"{options.task} {side}", {})
            if str(seed) not in done:
                done[str(seed)] = solved_at(SIDES[side](task, seed), levels)
                write_atomically(options.out, json.dumps(runs, indent=1).encode())
    tell(runs)


if __name__ == "__main__":
    main()
