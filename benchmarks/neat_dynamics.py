"""Our NEAT against the real TensorNEAT: does the same evolution happen? Exact rank tests between seeds of both.

    python benchmarks/neat_dynamics.py growth-code --seeds 12 [--side ours|theirs] [--at-once 1] [--out FOLDER]
    python benchmarks/neat_dynamics.py levels --seeds 10 [--side ours|theirs] [--at-once 1] [--out FOLDER]

growth-code: the population's mean number of nodes in generation 120 on 6-parity, last level: 256 genomes of at most 32
nodes and 96 connections, the published code's rate of new nodes. growth: the same with the paper's rate, twice that;
here TensorNEAT's genomes are expected to be larger, because its species of one member take the newest genome of all
for their second elite, and ours have one elite. levels: on 6-parity from two bits up (1,024 genomes, 20 species, 1,000
generations), the generation that first solved two bits, and how many levels were solved.

Both sides are methods of the same trial engine, with the paper's hyperparameters and TensorNEAT's treatment of a new
level. Trials are kept in the folder as they end, and interrupted ones go on from a checkpoint: the same call again
continues, and sides and seeds may come from different calls. `dynamics.json` in it holds all numbers. A GPU wants all
seeds at once; a CPU, one after the other.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from evoclaims.trials import devices

devices.configure()

from evoclaims.core.errors import UserError  # noqa: E402
from evoclaims.core.files import write_atomically  # noqa: E402
from evoclaims.envs.gates.parity import NParity  # noqa: E402
from evoclaims.judging.exact import rank_test  # noqa: E402
from evoclaims.methods.neat.evolution import Neat  # noqa: E402
from evoclaims.methods.neat.settings import Mutation, Settings, Species  # noqa: E402
from evoclaims.methods.tensorneat import NeatTensorneat  # noqa: E402
from evoclaims.trials.result import TrialResult  # noqa: E402
from evoclaims.trials.runner import run  # noqa: E402
from evoclaims.trials.spec import Budget, Condition  # noqa: E402
from evoclaims.trials.store import Store  # noqa: E402

SIDES: dict[str, Any] = {"ours": Neat, "theirs": NeatTensorneat}
NEVER = 10**6
"""Stands for a level that was not solved in time: a number above all others, so that it can be ranked and stored."""


@dataclass(frozen=True)
class Comparison:
    """What both sides run, and what is read off a trial.

    Attributes:
        settings, progression, generations: of every trial.
        measures: by name, a number of a trial, given the environment steps of a generation.
    """

    settings: Settings
    progression: Any
    generations: int
    measures: Mapping[str, Callable[[TrialResult, int], float]]


def solved_first(trial: TrialResult, cost: int) -> float:
    """Return the generation that first solved level 0."""
    steps = trial.levels["solved_at"][0]
    return steps / cost if steps > 0 else NEVER


def last_nodes(trial: TrialResult, _: int) -> float:
    """Return the population's mean number of nodes in the last generation."""
    return trial.curves["nodes"][-1]


SMALL = Settings(population=256, nodes=32, connections=96, species=Species(on_level_up="keep"))
COMPARISONS = {
    "growth": Comparison(
        settings=SMALL,
        progression="direct",
        generations=120,
        measures={"nodes in the last generation": last_nodes},
    ),
    "growth-code": Comparison(
        settings=replace(SMALL, mutation=Mutation(node_add=0.1)),
        progression="direct",
        generations=120,
        measures={"nodes in the last generation": last_nodes},
    ),
    "levels": Comparison(
        settings=Settings(population=1_024, species=Species(most=20, on_level_up="keep")),
        progression="curriculum",
        generations=1_000,
        measures={
            "generation that solved level 0": solved_first,
            "levels solved": lambda trial, _: trial.metrics["furthest_solved"] + 1,
        },
    ),
}


def read(path: Path) -> dict[str, dict[str, dict[str, float]]]:
    """Return the numbers so far: by comparison, measure and side, a mapping from seed to number."""
    return json.loads(path.read_text()) if path.exists() else {}


def grow(name: str, comparison: Comparison, side: str, seeds: int, at_once: int, folder: Path, device: str) -> None:
    """Run the trials of one side that are missing, and write their numbers."""
    task, method = NParity(bits=6), SIDES[side](comparison.settings)
    budget = Budget(generations=comparison.generations, reports=-(-comparison.generations // 50))
    condition = Condition(method, task, comparison.progression, budget)
    for first in range(0, seeds, at_once):
        batch = range(first, min(first + at_once, seeds))
        began = time.perf_counter()
        trials = run(condition, batch, Store(folder / "trials"), devices.choose(device)[:1])
        numbers = read(folder / "dynamics.json")
        for measure, of in comparison.measures.items():
            values = numbers.setdefault(f"{name}: {measure}, {comparison.generations} generations", {})
            values.setdefault(side, {}).update({str(t.seed): of(t, method.cost(task)) for t in trials})
        write_atomically(folder / "dynamics.json", json.dumps(numbers, indent=1).encode())
        print(
            f"{side} {name}: seeds {batch.start} to {batch.stop - 1} in {time.perf_counter() - began:.0f} s", flush=True
        )


def shown(value: float) -> str:
    """Return a number as it is printed."""
    return "never" if value == NEVER else f"{value:.4g}"


def tell(numbers: Mapping[str, Mapping[str, Mapping[str, float]]]) -> None:
    """Print every measure's values, and an exact two-sided p where both sides have some."""
    for measure, sides in numbers.items():
        print(measure)
        for side, by_seed in sides.items():
            values = sorted(by_seed.values())
            spread = ""
            if len(values) > 1 and NEVER not in values:
                spread = f"{statistics.mean(values):.2f} ± {statistics.stdev(values):.2f}, "
            print(f"  {side:<7} {spread}median {shown(statistics.median_low(values))} (n = {len(values)}): ", end="")
            print(*map(shown, values))
        if set(sides) == set(SIDES):
            a, b = (list(sides[side].values()) for side in SIDES)
            one, other = rank_test(a, b), rank_test(b, a)
            print(f"  exact rank test, two-sided: p = {min(1.0, 2 * min(one.p, other.p)):.3f}")


def main() -> None:
    """Run what is asked for and print all there is."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("comparison", choices=COMPARISONS)
    parser.add_argument("--side", choices=SIDES, help="run this side only")
    parser.add_argument("--seeds", type=int, default=12)
    parser.add_argument("--at-once", type=int, default=1, help="trials in one program")
    parser.add_argument("--generations", type=int, help="instead of the comparison's own number")
    parser.add_argument("--device", choices=devices.DEVICE_NAMES, default="auto")
    parser.add_argument("--out", type=Path, default=Path("neat-dynamics"), help="folder of trials and dynamics.json")
    options = parser.parse_args()
    plan = COMPARISONS[options.comparison]
    if options.generations:
        plan = Comparison(plan.settings, plan.progression, options.generations, plan.measures)
    try:
        for side in [options.side] if options.side else SIDES:
            grow(options.comparison, plan, side, options.seeds, options.at_once, options.out, options.device)
        tell(read(options.out / "dynamics.json"))
    except UserError as error:
        raise SystemExit(str(error)) from None


if __name__ == "__main__":
    main()
