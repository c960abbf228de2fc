"""The real TensorNEAT as a method, and ours held against it genome by genome; most of it runs where it is installed."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from workbench import Workbench, close

from evoclaims.core.errors import UserError
from evoclaims.core.foreign import implicit_promotions
from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.hyperneat import HyperNeat
from evoclaims.methods.hyperneat_tensorneat import HyperneatTensorneat
from evoclaims.methods.neat.evolution import Neat
from evoclaims.methods.neat.homology import distance
from evoclaims.methods.neat.population import offspring
from evoclaims.methods.neat.settings import Attribute, Mutation, Settings, Species
from evoclaims.methods.neat.species import SpeciesState, speciate
from evoclaims.methods.tensorneat import Genes, NeatTensorneat, library, neat, translated
from evoclaims.networks.graph import GraphNetwork
from evoclaims.trials.result_making import is_sound

SMALL = Settings(population=60, nodes=12, connections=30, species=Species(most=5))
METHODS = {"neat_tensorneat": NeatTensorneat(SMALL), "hyperneat_tensorneat": HyperneatTensorneat(SMALL, hidden=(3,))}
LIVELY = Settings(
    population=64,
    nodes=20,
    connections=40,
    activations=("tanh", "sin", "gauss"),
    mutation=Mutation(node_add=0.5, connection_add=0.9),
    species=Species(most=6, threshold=1.2, survival=0.3),
)
TASK = NParity(3)
LEVEL = jnp.zeros((), jnp.int32)
installed = pytest.mark.skipif(importlib.util.find_spec("tensorneat") is None, reason="TensorNEAT is not installed")


@pytest.fixture(scope="module")
def benches() -> dict[str, Workbench]:
    return {name: Workbench(method, NParity(2)) for name, method in METHODS.items()}


@pytest.fixture(params=METHODS)
def bench(request: pytest.FixtureRequest, benches: dict[str, Workbench]) -> Workbench:
    return benches[request.param]


@pytest.fixture(scope="module")
def evolved() -> Any:
    """Our population after forty lively generations: genomes of many sizes, in several species."""
    with jax.numpy_dtype_promotion("strict"), jax.numpy_rank_promotion("raise"):
        state, _ = Workbench(Neat(LIVELY), TASK).run(40)
    assert len(np.unique(state.population.genomes.node_count)) > 5
    assert int(state.population.species.count) > 2
    return state.population


@pytest.mark.parametrize("method", METHODS.values(), ids=list(METHODS))
def test_without_tensorneat_a_sentence_says_how_to_install_it(method: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "tensorneat", None)
    with pytest.raises(UserError, match=r"cannot be imported \(.*\)\. Install it with: pip install .*tensorneat"):
        method.init(jax.random.key(0), NParity(2))


def test_importing_the_adapters_does_not_import_tensorneat(tmp_path: Path) -> None:
    (tmp_path / "tensorneat.py").write_text("raise SystemExit('imported')")
    program = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); import evoclaims.methods.hyperneat_tensorneat"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("wrong", [{"hidden": (0,)}, {"threshold": 1.0}, {"max_weight": 0.0}, {"extent": "layer"}])
def test_a_substrate_that_cannot_be_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(UserError):
        HyperneatTensorneat(**wrong)


@installed
def test_a_network_that_does_not_fit_is_refused() -> None:
    with pytest.raises(UserError, match="starts with 4 nodes"):
        NeatTensorneat(replace(SMALL, nodes=3)).init(jax.random.key(0), NParity(3))


@installed
def test_every_hyperparameter_arrives() -> None:
    odd = Attribute(mean=0.5, std=0.25, power=0.75, mutate_rate=0.125, replace_rate=0.0625, bound=3.0)
    mutation = Mutation(0.11, 0.12, 0.13, 0.14, odd, replace(odd, mean=0.6), replace(odd, mean=0.7), 0.15)
    species = Species(7, 1.5, 0.9, 0.3, 12, 3, "keep", 4, 0.2, 0.7)
    algorithm = neat(replace(LIVELY, output="sigmoid", mutation=mutation, species=species), 3, 2)
    genome, controller = algorithm.genome, algorithm.species_controller
    names = ("node_add", "node_delete", "conn_add", "conn_delete")
    assert [getattr(genome.mutation, name) for name in names] == [0.11, 0.12, 0.13, 0.14]
    for name, gene, mean in (
        ("bias", genome.node_gene, 0.5),
        ("response", genome.node_gene, 0.6),
        ("weight", genome.conn_gene, 0.7),
    ):
        names = ("init_mean", "init_std", "mutate_power", "mutate_rate", "replace_rate", "upper_bound")
        assert [getattr(gene, f"{name}_{part}") for part in names] == [mean, 0.25, 0.75, 0.125, 0.0625, 3.0]
    lower = (
        genome.node_gene.bias_lower_bound,
        genome.node_gene.reponse_lower_bound,
        genome.conn_gene.weight_lower_bound,
    )
    assert lower == (-3.0, -3.0, -3.0)
    assert genome.node_gene.activation_replace_rate == 0.15
    assert [genome.num_inputs, genome.num_outputs, genome.max_nodes, genome.max_conns] == [3, 2, 20, 40]
    assert float(genome.output_transform(jnp.zeros(()))) == 0.5
    assert [genome.distance.compatibility_disjoint, genome.distance.compatibility_weight] == [0.9, 0.3]
    names = ("species_size", "compatibility_threshold", "max_stagnation", "species_elitism", "genome_elitism")
    assert [getattr(controller, name) for name in names] == [7, 1.5, 12, 3, 4]
    names = ("survival_threshold", "spawn_number_change_rate", "pop_size", "min_species_size")
    assert [getattr(controller, name) for name in names] == [0.2, 0.7, 64, 1]


@installed
def test_progress_tells_what_the_best_policy_does_and_how_large_it_is(bench: Workbench) -> None:
    state, told = bench.init(), []
    inputs = np.sum(~np.isnan(state.champion.nodes[:, 0]))
    for seed in range(25):
        # Elites come first: backwards, so that the champion is not always the first genome.
        genomes = {name: state.library[name][::-1] for name in ("pop_nodes", "pop_conns")}
        backwards = replace(state, library={**state.library, **genomes})
        state, (progress,) = bench.run(1, seed=seed, state=backwards)
        metrics, champion = progress.metrics, state.champion
        for name, genes in (("nodes", champion.nodes), ("connections", champion.connections)):
            assert float(metrics[f"champion_{name}"]) == np.sum(~np.isnan(genes[:, 0]))
        assert 1 <= float(metrics["species"]) <= SMALL.species.most
        told.append(float(metrics["nodes"]))
    assert told[0] == pytest.approx(inputs)
    assert told[-1] > told[0]
    examined = bench.examine(state)
    assert float(progress.fitness) == pytest.approx(float(examined.fitness))
    assert float(progress.success) == float(examined.success)


@installed
@pytest.mark.parametrize(
    ("on_level_up", "level", "forgotten"), [("reset", 1, True), ("reset", 0, False), ("keep", 1, False)]
)
def test_a_new_level_resets_records_if_told_to(on_level_up: Any, level: int, forgotten: bool) -> None:
    species = replace(SMALL.species, on_level_up=on_level_up)
    method = NeatTensorneat(replace(SMALL, population=20, species=species))
    step = partial(method.step, jax.random.key(1), TASK, jnp.asarray(level, jnp.int32))
    state = method.init(jax.random.key(0), TASK)
    records = {**state.library["species"], "best_fitness": jnp.where(jnp.arange(5) == 0, 100.0, jnp.nan)}
    after, _ = jax.jit(step)(replace(state, library={**state.library, "species": records}))
    assert (float(after.library["species"]["best_fitness"][0]) < 1) == forgotten


@installed
def test_ours_and_tensorneats_forward_pass_agree(evolved: Any) -> None:
    network = GraphNetwork(TASK.observation_size, TASK.action_size, LIVELY.activations, LIVELY.output)
    rows = jnp.concatenate([jax.random.normal(jax.random.key(0), (6, 3)), jnp.array([[0.5, jnp.nan, 1.0]])])
    theirs = NeatTensorneat(LIVELY).best(TASK, _state()).function

    def both(genome: Any) -> tuple[Any, Any]:
        graph, genes = network.express(genome), translated(genome)
        return jax.vmap(partial(network.apply, graph))(rows), jax.vmap(partial(theirs, genes))(rows)

    one, other = jax.jit(jax.vmap(both))(evolved.genomes)
    assert np.std(one) > 0.3
    np.testing.assert_allclose(one, other, atol=1e-5)


@installed
def test_ours_and_tensorneats_distance_agree(evolved: Any) -> None:
    genome = neat(LIVELY, TASK.observation_size, TASK.action_size).genome
    genomes = evolved.genomes
    others = jax.tree.map(lambda leaf: jnp.roll(leaf, 7, axis=0), genomes)

    def ours(one: Any, other: Any) -> Any:
        return distance(LIVELY.species, one, other)

    def theirs(one: Genes, other: Genes) -> Any:
        with implicit_promotions():
            return genome.execute_distance(_empty(), one.nodes, one.connections, other.nodes, other.connections)

    translations = jax.vmap(translated)(genomes), jax.vmap(translated)(others)
    one = jax.jit(jax.vmap(ours))(genomes, others)
    assert np.std(one) > 0.1
    np.testing.assert_allclose(one, jax.jit(jax.vmap(theirs))(*translations), atol=1e-5)


@installed
def test_ours_and_tensorneat_form_the_same_species(evolved: Any) -> None:
    """From one population and its old centres, whom each genome joins, and how many children each species gets."""
    species: SpeciesState = evolved.species
    others = jax.tree.map(lambda leaf: leaf[::-1], evolved.genomes)
    ours = jax.jit(partial(speciate, LIVELY.species))(species, others, evolved.generation)
    controller = neat(LIVELY, TASK.observation_size, TASK.action_size)
    places = jnp.arange(LIVELY.species.most)
    alive, State = places < species.count, library().common.State
    genes, centres = jax.vmap(translated)(others), jax.vmap(translated)(species.centres)
    known = State(
        species_keys=jnp.where(alive, places.astype(jnp.float32), jnp.nan),
        best_fitness=jnp.where(alive, species.best, jnp.nan),
        last_improved=jnp.where(alive, species.improved_at.astype(jnp.float32), jnp.nan),
        member_count=jnp.where(alive, species.size.astype(jnp.float32), jnp.nan),
        idx2species=species.member_of.astype(jnp.float32),
        center_nodes=jnp.where(alive[:, None, None], centres.nodes, jnp.nan),
        center_conns=jnp.where(alive[:, None, None], centres.connections, jnp.nan),
        next_species_key=species.count.astype(jnp.float32),
    )
    state = State(
        pop_nodes=genes.nodes,
        pop_conns=genes.connections,
        generation=evolved.generation.astype(jnp.float32),
        species=known,
    )
    with implicit_promotions():
        theirs = jax.jit(lambda s: controller.species_controller.speciate(s, controller.genome.execute_distance))(state)
        spawned = controller.species_controller._cal_spawn_numbers_by_rank(theirs.species)
    np.testing.assert_array_equal(ours.member_of, theirs.species.idx2species)
    assert len(np.unique(ours.member_of)) > 2
    close(jax.vmap(translated)(ours.centres).nodes[: int(ours.count)], theirs.species.center_nodes[: int(ours.count)])
    np.testing.assert_array_equal(offspring(LIVELY.species, ours, LIVELY.population), spawned)


@installed
@pytest.mark.parametrize("extent", ["largest_layer", "unit"])
def test_ours_and_tensorneats_hyperneat_draw_the_same_network(extent: Any) -> None:
    settings = replace(LIVELY, population=16, species=Species(most=2))
    ours, theirs = (kind(settings, hidden=(4, 3), extent=extent) for kind in (HyperNeat, HyperneatTensorneat))
    state, _ = Workbench(ours, TASK).run(12)
    rows, encoding = jnp.asarray(TASK.table.inputs), ours.encoding(TASK)
    act = theirs.best(TASK, _state()).function

    def both(genome: Any) -> tuple[Any, Any]:
        network, genes = encoding.express(genome), translated(genome)
        return jax.vmap(partial(encoding.apply, network))(rows), jax.vmap(partial(act, genes))(rows)

    one, other = jax.jit(jax.vmap(both))(state.population.genomes)
    assert np.std(one) > 0.1
    np.testing.assert_allclose(one, other, atol=1e-5)


def _empty() -> Any:
    """Return TensorNEAT's state with nothing in it, which is all that looking at a genome needs."""
    return library().common.State()


def _state() -> Any:
    """Return a state to make a policy from whose function alone is wanted."""
    return NeatTensorneat(SMALL).init(jax.random.key(0), NParity(2))


@pytest.mark.parametrize("name", METHODS)
def test_a_genome_is_sound_though_nan_stands_where_there_is_no_gene(name: str) -> None:
    nodes, links = np.full((4, 5), np.nan, np.float32), np.full((3, 3), np.nan, np.float32)
    nodes[:2], links[0] = 0.5, 0.25
    assert is_sound(METHODS[name], Genes(nodes=nodes, connections=links))
    for table, worst in ((nodes, np.nan), (nodes, np.inf), (links, np.nan), (links, -np.inf)):
        was, table[0, 2] = table[0, 2], worst
        assert not is_sound(METHODS[name], Genes(nodes=nodes, connections=links))
        table[0, 2] = was
