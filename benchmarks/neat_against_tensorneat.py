"""Our NEAT against the real TensorNEAT, generations per second on 6-parity, in turns.

    python benchmarks/neat_against_tensorneat.py [--cases small species grown] [--rounds 5] [--generations 5]
    python benchmarks/neat_against_tensorneat.py --device gpu --cases ten ten-5000 --generations 50
    python benchmarks/neat_against_tensorneat.py --device gpu --cases ten-5000-grown --generations 20 --alone

small: 1,024 genomes, from the first generation. species: the same with the threshold of species lowered on both sides,
so that all 20 are alive. grown: 256 genomes of 100 nodes, the same random networks on both sides. ten, ten-5000: ten
trials of ours at once against one of theirs, in seed-generations per second; 1,024 and 5,000 genomes. ten-5000-grown:
the same with networks as in grown. --alone: without TensorNEAT.

Both sides are methods of the same trial engine, with the same hyperparameters (the paper's; 20 species); every turn
runs the same generations from the same start, until a second has passed. TensorNEAT is spared the printing and waiting
of its own pipeline. Compilation, without a cache, is not part of the rates.
"""

from __future__ import annotations

import argparse
import statistics
import time
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from evoclaims.trials import devices

devices.configure()

import jax  # noqa: E402
import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402

from evoclaims.core.errors import UserError  # noqa: E402
from evoclaims.envs.gates.parity import NParity  # noqa: E402
from evoclaims.methods.neat.evolution import Neat  # noqa: E402
from evoclaims.methods.neat.settings import Settings, Species  # noqa: E402
from evoclaims.methods.neat.species import one_species  # noqa: E402
from evoclaims.methods.tensorneat import NeatTensorneat, library, translated  # noqa: E402
from evoclaims.networks.genome import Connections, Genome, Nodes  # noqa: E402
from evoclaims.trials.lanes import Lanes  # noqa: E402
from evoclaims.trials.spec import Budget, Condition  # noqa: E402

TASK = NParity(bits=6)
LINKS = 183  # connections of a full-size genome


@dataclass(frozen=True)
class Case:
    """What is compared.

    Attributes:
        settings: of both sides.
        trials: of ours at once.
        warm_up: generations before the start that turns go back to.
        grown: whether the first population is made of full-size genomes.
    """

    settings: Settings
    trials: int = 1
    warm_up: int = 1
    grown: bool = False


def sized(population: int, threshold: float = 2.0) -> Settings:
    """Return the paper's hyperparameters with 20 species."""
    return Settings(population=population, species=Species(most=20, threshold=threshold, on_level_up="keep"))


CASES = {
    "small": Case(sized(1_024)),
    "species": Case(sized(1_024, threshold=0.3), warm_up=3),
    "grown": Case(sized(256), grown=True),
    "ten": Case(sized(1_024), trials=10),
    "ten-5000": Case(sized(5_000), trials=10),
    "ten-5000-grown": Case(sized(5_000), trials=10, grown=True),
}


def random_genomes(settings: Settings, kinds: int = 4, seed: int = 0) -> Genome:
    """Make a population of full-size genomes of a few kinds; those of a kind differ in their numbers alone."""
    rng = np.random.default_rng(seed)
    inputs, size, count = TASK.observation_size, settings.nodes, settings.population
    linked = np.zeros((kinds, size, size), bool)
    for kind in linked:
        for target in range(inputs, size):  # from one of the last three, so that networks are about 50 deep
            kind[target, rng.integers(max(0, target - 3), target)] = True
        while kind.sum() < LINKS:
            target = rng.integers(inputs, size)
            kind[target, rng.integers(0, target)] = True
    print(f"grown genomes: {size} nodes, {LINKS} connections, depths {[depth(kind, inputs) for kind in linked]}")
    ends = np.zeros((kinds, 2, settings.connections), np.int32)
    ends[:, :, :LINKS] = [np.stack(np.nonzero(kind)) for kind in linked]
    ends = ends[np.arange(count) % kinds]
    # The output is in the last slot; its key follows the inputs' keys.
    keys = np.array([*range(inputs), *range(inputs + 1, size), inputs], np.int32)
    numbers = rng.normal(size=(count, size + settings.connections)).astype(np.float32)
    numbers[:, size + LINKS :] = 0
    genomes = Genome(
        nodes=Nodes(
            key=np.broadcast_to(keys, (count, size)),
            bias=numbers[:, :size],
            response=np.ones((count, size), np.float32),
            activation=np.zeros((count, size), np.int32),
        ),
        connections=Connections(ends[:, 1], ends[:, 0], numbers[:, size:]),
        node_count=np.full(count, size, np.int32),
        connection_count=np.full(count, LINKS, np.int32),
    )
    return jax.tree.map(jnp.asarray, genomes)


def depth(linked: np.ndarray, inputs: int) -> int:
    """Return how many connections the longest path has."""
    longest = np.zeros(len(linked), int)
    for target in range(inputs, len(linked)):
        longest[target] = 1 + longest[linked[target]].max()
    return int(longest.max())


def with_ours(settings: Settings, genomes: Genome, state: Any) -> Any:
    """Put a first population into the state of our NEAT."""
    species = one_species(settings.species, genomes)
    key = jnp.max(genomes.nodes.key) + 1
    return replace(state, population=replace(state.population, genomes=genomes, species=species, next_key=key))


def with_theirs(genomes: Genome, state: Any) -> Any:
    """Put a first population into the state of TensorNEAT."""
    genes = jax.vmap(translated)(genomes)
    species = state.library["species"]
    nodes = species["center_nodes"].at[0].set(genes.nodes[0])
    connections = species["center_conns"].at[0].set(genes.connections[0])
    grouped = {**species, "center_nodes": nodes, "center_conns": connections}
    population = {"pop_nodes": genes.nodes, "pop_conns": genes.connections, "species": grouped}
    return replace(state, library={**state.library, **population})


class Side:
    """One side's trials, which can be run from their start as often as wanted."""

    def __init__(self, method: Any, case: Case, trials: int, device: jax.Device, place: Any) -> None:
        """Compile, and run up to the start; `place` puts the first population into a method's state."""
        condition = Condition(method, TASK, "direct", Budget(generations=10**9))
        self.lanes, self.trials = Lanes(condition, [device]), trials
        state = self.lanes.start(range(trials), trials)
        self.lanes.programs(trials)
        if case.grown:
            state = tuple(replace(share, method=jax.vmap(place)(share.method)) for share in state)
        state, _ = self.lanes.advance(state, case.warm_up, trials)
        self.start, self.begin = self.lanes.gather(state), case.warm_up

    def rate(self, generations: int) -> float:
        """Return seed-generations per second."""
        took, runs = 0.0, 0
        while took < 1.0:
            state = jax.block_until_ready(self.lanes.place(self.start, self.trials))
            began = time.perf_counter()
            state, report = self.lanes.advance(state, self.begin + generations, self.trials)
            jax.block_until_ready(state)
            took, runs = took + time.perf_counter() - began, runs + 1
        if report.ended.any():
            raise SystemExit("A trial has solved the task; ask for fewer generations.")
        sizes = {name: float(np.mean(report.metrics[name])) for name in ("nodes", "connections", "species")}
        self.seen = ", ".join(f"{name} {size:.1f}" for name, size in sizes.items())
        return runs * self.trials * generations / took


def alone(name: str, rounds: int, generations: int, device: jax.Device) -> None:
    """Measure our side of one case and print it."""
    case = CASES[name]
    ours = our_side(case, first_genomes(case), device)
    rates = sorted(ours.rate(generations) for _ in range(rounds))
    print(
        f"{name}: {statistics.median(rates):,.1f}/s, from {rates[0]:,.1f} to {rates[-1]:,.1f}, on {device.device_kind}"
    )
    print(f"  compiled in {ours.lanes.seconds:.1f} s; at the end {ours.seen}", flush=True)


def first_genomes(case: Case) -> Genome | None:
    """Make the first population of a case, if it is not the methods' own."""
    return random_genomes(case.settings) if case.grown else None


def our_side(case: Case, genomes: Genome | None, device: jax.Device) -> Side:
    """Return our side of a case."""
    return Side(Neat(case.settings), case, case.trials, device, partial(with_ours, case.settings, genomes))


def compare(name: str, rounds: int, generations: int, device: jax.Device) -> None:
    """Measure one case in turns and print it."""
    case = CASES[name]
    genomes = first_genomes(case)
    ours = our_side(case, genomes, device)
    theirs = Side(NeatTensorneat(case.settings), case, 1, device, partial(with_theirs, genomes))
    rows = [(ours.rate(generations), theirs.rate(generations)) for _ in range(rounds)]
    for a, b in rows:
        print(f"  ours {a:>9,.1f}/s   TensorNEAT {b:>8,.2f}/s   ratio {a / b:.1f}")
    print(f"{name}: median ratio {statistics.median(a / b for a, b in rows):.1f} on {device.device_kind}")
    print(f"  compiled in {ours.lanes.seconds:.1f} s (TensorNEAT: {theirs.lanes.seconds:.1f} s)")
    print(f"  at the end: ours {ours.seen}; TensorNEAT {theirs.seen}", flush=True)


def main() -> None:
    """Measure the cases that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--cases", nargs="+", choices=CASES, default=["small", "species", "grown"])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--generations", type=int, default=5, help="in a turn")
    parser.add_argument("--device", choices=devices.DEVICE_NAMES, default="auto")
    parser.add_argument("--alone", action="store_true", help="without TensorNEAT")
    options = parser.parse_args()
    jax.config.update("jax_enable_compilation_cache", False)
    try:
        if not options.alone:
            library()
        for name in options.cases:
            (alone if options.alone else compare)(
                name, options.rounds, options.generations, devices.choose(options.device)[0]
            )
    except UserError as error:
        raise SystemExit(str(error)) from None


if __name__ == "__main__":
    main()
