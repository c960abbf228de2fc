"""The kernel of the forward pass against the pass by matrices, and against a walk in float64."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any, Final

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from assembler import assemble, kernels_for_gpus
from block_machine import run
from hypothesis import example, given, settings
from hypothesis import strategies as st

from evoclaims.core.errors import UnknownNameError
from evoclaims.kernels.call import grouped
from evoclaims.kernels.emit import group_kernel, machine_code
from evoclaims.kernels.emit.gpu_kernel import GpuProgram
from evoclaims.networks import graph
from evoclaims.networks.genome import EMPTY, Connections, Genome, Nodes
from evoclaims.networks.graph import GraphNetwork

INPUTS, OUTPUTS, NODES, LINKS = 3, 2, 12, 40
NAMES: Final = ("tanh", "sigmoid", "sin", "gauss", "abs", "identity")
NETWORK: Final = GraphNetwork(INPUTS, OUTPUTS, NAMES, "sigmoid")
FUNCTIONS: Final = {
    "tanh": np.tanh,
    "sigmoid": lambda z: 1 / (1 + np.exp(-z)),
    "sin": np.sin,
    "gauss": lambda z: np.exp(-z * z),
    "abs": np.abs,
    "identity": lambda z: z,
}
VALUES: Final = st.sampled_from([0.0, 1.0, -0.5, 2.5, -3.0, 1e30, np.nan, np.inf, -np.inf, 0.3, -1.7])


def _random_genomes(seed: int, count: int, fill: float = 0.3) -> Genome:
    """Draw genomes of all sizes; of some slots nothing leads to, and some have no connections."""
    draw = np.random.default_rng(seed)
    sizes = draw.integers(INPUTS + OUTPUTS, NODES + 1, count)
    keys, ends = np.full((count, NODES), EMPTY), np.zeros((2, count, LINKS), np.int32)
    links = np.zeros(count, np.int32)
    for i, size in enumerate(sizes):
        keys[i, :size] = [*range(INPUTS), *(INPUTS + draw.permutation(size - INPUTS))]
        possible = np.argwhere(np.tri(size, k=-1) * (draw.random((size, size)) < fill * (i % 4)))
        chosen = draw.permutation(possible[possible[:, 0] >= INPUTS])[:LINKS]  # in no order
        links[i] = len(chosen)
        ends[:, i, : len(chosen)] = chosen.T
    there = np.arange(LINKS) < links[:, None]
    weights = np.where(there, draw.normal(size=(count, LINKS)), 0)
    genes = Genome(
        nodes=Nodes(
            key=np.int32(keys),
            bias=np.float32(draw.normal(size=(count, NODES))),
            response=np.float32(draw.normal(size=(count, NODES))),
            activation=np.int32(draw.integers(0, len(NAMES), (count, NODES))),
        ),
        connections=Connections(source=ends[1], target=ends[0], weight=np.float32(weights)),
        node_count=np.int32(sizes),
        connection_count=links,
    )
    made: Genome = jax.tree.map(jnp.asarray, genes)
    return made


def _walked(genomes: Genome, which: int, row: Any) -> Any:
    """Return a genome's answers in float64."""
    genome = jax.tree.map(lambda leaf: np.asarray(leaf[which]), genomes)
    genes = genome.connections
    targets, sources = genes.target.tolist(), genes.source.tolist()
    values = {slot: float(x) for slot, x in enumerate(row) if np.isfinite(x)}
    answers = np.zeros(OUTPUTS)
    for slot in range(INPUTS, int(genome.node_count)):
        into = [c for c in range(int(genome.connection_count)) if targets[c] == slot and sources[c] in values]
        if not into:
            continue
        received = sum(float(genes.weight[c]) * values[sources[c]] for c in into)
        z = float(genome.nodes.bias[slot]) + float(genome.nodes.response[slot]) * received
        output = int(genome.nodes.key[slot]) - INPUTS
        value = z if output < OUTPUTS else FUNCTIONS[NAMES[genome.nodes.activation[slot]]](z)
        values[slot] = float(value) if np.isfinite(np.float32(value)) else 0.0
        if output < OUTPUTS:
            answers[output] = FUNCTIONS[NETWORK.output](values[slot])
    return answers


def _answers(genomes: Genome, rows: Any) -> Any:
    """Return the answers of every genome to every row."""
    wirings = jax.jit(jax.vmap(NETWORK.express))(genomes)
    return np.asarray(jax.jit(jax.vmap(jax.vmap(NETWORK.apply, (None, 0)), (0, None)))(wirings, rows))


@jax.jit
def _by_kernel(genomes: Genome, rows: Any) -> Any:
    return jax.vmap(jax.vmap(NETWORK.apply, (None, 0)), (0, None))(jax.vmap(NETWORK.express)(genomes), rows)


@jax.jit
def _by_matrices(genomes: Genome, rows: Any) -> Any:
    return jax.vmap(lambda g: jax.vmap(partial(NETWORK.propagate, NETWORK.matrices(NETWORK.express(g))))(rows))(genomes)


ROW: Final = st.tuples(VALUES, VALUES, VALUES)


# One row and several: each number of them is a program of its own.
@given(st.integers(0, 2**31), st.sampled_from([1, 9]).flatmap(lambda n: st.lists(ROW, min_size=n, max_size=n)))
@example(0, [(np.nan, np.nan, np.nan), (np.inf, 1.0, -np.inf), *[(1.0, 1.0, 1.0)] * 7])
@settings(max_examples=25, deadline=None)
def test_the_kernel_is_the_walk_and_the_pass_by_matrices(seed: int, given_rows: list[tuple[float, ...]]) -> None:
    """An input that is so large that a sine has no accurate quadrant is left to the next test."""
    genomes, rows = _random_genomes(seed, 8), np.array(given_rows, np.float32)
    rows = np.where(np.abs(rows) == np.float32(1e30), np.float32(-1.25), rows)
    made, plain = _by_kernel(genomes, rows), jax.device_get(genomes)
    for genome in range(8):
        with np.errstate(all="ignore"):
            wanted = np.array([_walked(plain, genome, row) for row in rows])
        np.testing.assert_allclose(made[genome], wanted, rtol=1e-4, atol=2e-4)
    np.testing.assert_allclose(made, _by_matrices(genomes, rows), rtol=1e-4, atol=2e-4)


def test_what_overflows_is_passed_on_as_0() -> None:
    genomes, rows = _random_genomes(5, 40), np.full((1, INPUTS), 3e38, np.float32)
    network = GraphNetwork(INPUTS, OUTPUTS, ("identity",) * len(NAMES), "identity")
    wirings = jax.vmap(network.express)(genomes)
    doubled = jax.tree.map(jnp.asarray, wirings)
    made = jax.jit(jax.vmap(network.apply, (0, None)))(doubled, rows[0])
    assert np.isfinite(made).all()
    assert (np.asarray(made) == 0).any()


@pytest.mark.parametrize("widest", [1, 4, 16])
def test_bits_depend_neither_on_the_batch_nor_on_the_lanes(widest: int, monkeypatch: pytest.MonkeyPatch) -> None:
    genomes = _random_genomes(1, 9)
    rows = np.float32(np.random.default_rng(2).normal(size=(37, INPUTS)))
    rows[3, 0], rows[20] = np.nan, np.inf
    wirings = jax.jit(jax.vmap(NETWORK.express))(genomes)
    monkeypatch.setattr(machine_code, "lanes", lambda: widest)
    graph._kernel.cache_clear()
    many = jax.jit(lambda w, r: jax.vmap(jax.vmap(NETWORK.apply, (None, 0)), (0, None))(w, r))(wirings, rows)
    transposed = jax.jit(lambda w, r: jax.vmap(jax.vmap(NETWORK.apply, (0, None)), (None, 0))(w, r))(wirings, rows)
    np.testing.assert_array_equal(np.swapaxes(transposed, 0, 1), many)
    own = jax.jit(lambda w, r: jax.vmap(NETWORK.apply)(w, r))(wirings, rows[:9])
    np.testing.assert_array_equal(own, np.asarray(many)[np.arange(9), np.arange(9)])
    few = jax.jit(lambda w, r: jax.vmap(jax.vmap(NETWORK.apply, (None, 0)), (0, None))(w, r))(wirings, rows[:5])
    np.testing.assert_array_equal(few, np.asarray(many)[:, :5])


def _on_a_gpu(kernel: Any, groups: int, rows: int, arrays: list[Any]) -> list[Any]:
    """Return the results of a kernel's text for GPUs, on this processor; groups share their rows."""
    shared_rows = [False] * len(kernel.rows)
    text = group_kernel.gpu_text(kernel.write, kernel.sizes, groups, rows, shared_rows)
    results = [jax.ShapeDtypeStruct((groups * rows, *out.shape), out.dtype) for out in kernel.outputs]
    return run(text, GpuProgram("", kernel.name), groups * rows, arrays, results)


def test_a_gpus_kernels_compute_the_same_bits() -> None:
    genomes, count = _random_genomes(8, 9), 7
    rows = np.float32(np.random.default_rng(3).normal(size=(count, INPUTS)))
    rows[2, 1], rows[5] = np.nan, np.inf
    wirings = jax.jit(jax.vmap(NETWORK.express))(genomes)
    genes = genomes.connections
    arrays = [genes.source, genes.target, genes.weight, genomes.connection_count]
    for made, leaf in zip(
        _on_a_gpu(graph._sorting(NODES, LINKS), 9, 1, arrays),
        (wirings.source, wirings.weight, wirings.ends),
        strict=True,
    ):
        np.testing.assert_array_equal(made, leaf)
    (answers,) = _on_a_gpu(graph._kernel(NETWORK, (NODES, LINKS)), 9, count, [*jax.tree.leaves(wirings), rows])
    np.testing.assert_array_equal(answers.reshape(9, count, OUTPUTS), _answers(genomes, rows))


def test_trials_of_genomes_with_rows_of_their_own_or_not_are_the_genomes_alone() -> None:
    genomes = _random_genomes(4, 6)
    wirings = jax.jit(jax.vmap(NETWORK.express))(genomes)
    trials = jax.tree.map(lambda leaf: leaf.reshape(2, 3, *leaf.shape[1:]), wirings)
    rows = np.float32(np.random.default_rng(2).normal(size=(2, 3, 5, INPUTS)))

    def of(wiring: Any, given_rows: Any, kinds: tuple[Any, ...]) -> Any:
        function = NETWORK.apply
        for kind in reversed(kinds):
            function = jax.vmap(function, kind)
        return np.asarray(jax.jit(function)(wiring, given_rows))

    for_each = of(trials, rows, ((0, 0), (0, 0), (None, 0)))
    of_trials = of(trials, rows[:, 0], ((0, 0), (0, None), (None, 0)))
    of_genomes = of(trials, rows[0], ((0, None), (0, 0), (None, 0)))
    for t, g, r in np.ndindex(2, 3, 5):
        alone = NETWORK.apply(jax.tree.map(lambda leaf, t=t, g=g: leaf[t, g], trials), rows[t, g, r])
        np.testing.assert_array_equal(for_each[t, g, r], alone)
    np.testing.assert_array_equal(of_trials[1, 0], for_each[1, 0])
    np.testing.assert_array_equal(of_genomes[0, 2], for_each[0, 2])


def test_a_batch_of_nothing_is_nothing() -> None:
    wirings = jax.vmap(NETWORK.express)(_random_genomes(4, 3))
    none = jax.tree.map(lambda leaf: leaf[:0], wirings)
    assert jax.vmap(NETWORK.apply)(none, jnp.zeros((0, INPUTS))).shape == (0, OUTPUTS)
    rows = jax.vmap(jax.vmap(NETWORK.apply, (None, 0)), (0, None))(wirings, jnp.zeros((0, INPUTS)))
    assert rows.shape == (3, 0, OUTPUTS)


def test_connections_are_sorted_by_the_slot_they_lead_to_and_equals_keep_their_order() -> None:
    genomes = _random_genomes(7, 9)
    wirings = jax.jit(jax.vmap(NETWORK.express))(genomes)
    for i in range(9):
        genes, count = (
            jax.tree.map(lambda leaf, i=i: np.asarray(leaf[i]), genomes.connections),
            int(genomes.connection_count[i]),
        )
        order = np.argsort(genes.target[:count], kind="stable")
        np.testing.assert_array_equal(wirings.source[i][:count], genes.source[:count][order])
        np.testing.assert_array_equal(wirings.weight[i][:count], genes.weight[:count][order])
        assert not np.any(wirings.weight[i][count:])
        np.testing.assert_array_equal(wirings.ends[i], [(genes.target[:count] <= slot).sum() for slot in range(NODES)])


@pytest.fixture
def no_llvm(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A machine without llvmlite, which nothing knows yet."""
    caches = (machine_code.lanes, grouped._warn_once, graph._kernel, graph._sorting)
    monkeypatch.setattr(machine_code, "llvm", None)
    for cached in caches:
        cached.cache_clear()
    yield
    for cached in caches:
        cached.cache_clear()


@pytest.mark.usefixtures("no_llvm")
def test_without_llvm_the_pass_by_matrices_runs_and_one_warning_says_so() -> None:
    genomes, rows = _random_genomes(1, 9), np.float32(np.random.default_rng(2).normal(size=(5, INPUTS)))
    with pytest.warns(UserWarning, match="llvmlite") as warned:
        made = _answers(genomes, rows)
    assert len(warned) == 1
    for genome in range(9):
        wanted = np.array([_walked(genomes, genome, row) for row in rows])
        np.testing.assert_allclose(made[genome], wanted, rtol=1e-4, atol=2e-5)


@pytest.mark.parametrize("own", [None, 0])
def test_nvidias_assembler_takes_the_kernels(own: int | None, tmp_path: Path) -> None:
    genomes = _random_genomes(1, 9)
    rows = jnp.ones((5, INPUTS)) if own is None else jnp.ones((9, 5, INPUTS))

    def both(genome: Genome, given_rows: Any) -> Any:
        return jax.vmap(NETWORK.apply, (None, 0))(NETWORK.express(genome), given_rows)

    texts = kernels_for_gpus(jax.vmap(both, (0, own)), genomes, rows)
    assert len(texts) == 2  # sorting and walking
    for text in texts:
        assert re.search(r"\.visible \.entry the_forward_pass_of_genomes\(", text)
        assemble(text, tmp_path)


@pytest.mark.parametrize("names", [{"activations": ("tanh", "step")}, {"output": "step"}])
def test_an_unknown_function_is_one_sentence(names: dict[str, Any]) -> None:
    with pytest.raises(UnknownNameError, match="step"):
        GraphNetwork(1, 1, **names)


def test_lanes_are_as_many_as_rows_need() -> None:
    assert [group_kernel.lanes_for(rows, 8) for rows in (1, 2, 3, 8, 9, 31, 64, 1000)] == [1, 2, 4, 8, 16, 32, 32, 32]
