"""The distance of two genomes against the equation in float64."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import reference
from assembler import assemble, kernels_for_gpus
from block_machine import run
from genomes import CONNECTIONS, NODES, at, dags, made, read, stacked
from hypothesis import given, settings
from hypothesis import strategies as st
from reference import Node

from evoclaims.kernels.emit import group_kernel
from evoclaims.kernels.emit.gpu_kernel import GpuProgram
from evoclaims.kernels.genomes.gpu_distance import Comparison
from evoclaims.methods.neat import homology
from evoclaims.methods.neat.homology import STEP, _compared_with, _comparison, arranged, distance, distances
from evoclaims.methods.neat.settings import Species
from evoclaims.networks.genome import Genome

pytestmark = pytest.mark.slow


_distance = jax.jit(lambda one, other: distance(Species(), one, other))
_weighted = jax.jit(lambda one, other: distance(Species(disjoint=2.5, difference=0.7), one, other))


@settings(max_examples=80, deadline=None)
@given(dags(activations=3), dags(activations=3))
def test_any_two_genomes_are_as_far_apart_as_in_float64(one: Genome, other: Genome) -> None:
    wanted = reference.distance(read(one), read(other))
    np.testing.assert_allclose(_distance(one, other), wanted, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(_distance(other, one), wanted, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(_weighted(one, other), reference.distance(read(one), read(other), 2.5, 0.7), rtol=1e-5)
    assert float(_distance(one, one)) == 0.0


def test_the_distance_of_two_small_genomes_is_the_one_worked_out_by_hand() -> None:
    one = made([0, 1, 2, 5, 3], {(0, 2): 1.0, (1, 2): 2.0, (0, 5): 1.0}, {2: Node(0.5, 1.0, 0), 5: Node(9.0)})
    other = made([0, 1, 2, 3], {(0, 2): -1.0, (1, 3): 1.0}, {2: Node(-0.5, 3.0, 1)})
    nodes = (1.0 * 1 + 0.4 * (1.0 + 2.0 + 1.0)) / 5
    connections = (1.0 * 3 + 0.4 * 2.0) / 3
    np.testing.assert_allclose(_distance(one, other), nodes + connections, rtol=1e-6)


GENOMES, CENTRES = 4, 3


class _Way:
    """The distances of a population of which each genome is by itself, or of one that is arranged gene by gene."""

    def __init__(self, by_gene: bool) -> None:
        self.by_gene = by_gene
        self.comparison = Comparison(2.5, 0.7, GENOMES, by_gene, NODES, CONNECTIONS, STEP)
        self.kernel = _comparison(self.comparison, CENTRES)
        # Each operation alone takes three times as long.
        self.in_jax = jax.jit(lambda *given: self.kernel.function(*given)[0])
        self.by_this_processor = jax.jit(self.by_kernel)

    def by_kernel(self, population: Genome, *given: Any) -> Any:
        """Return what `distances` does."""
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(homology, "LARGE", GENOMES + (not self.by_gene))
            return distances(Species(disjoint=2.5, difference=0.7), arranged(population), *given)

    def given(self, population: Genome, centres: Genome, count: Any) -> list[Any]:
        """Return the kernel's arguments but the pair's number."""
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(homology, "LARGE", GENOMES + (not self.by_gene))
            leaves = jax.tree.leaves(arranged(population))
        return [*leaves, *_compared_with(self.comparison, centres), jnp.int32(count)]

    def by_a_gpus_threads(self, population: Genome, centres: Genome, count: Any) -> Any:
        """Return the distances that the kernel for GPUs finds, run by threads of the processor."""

        def call(groups: int, rows: int, own: list[bool], operands: list[Any], shapes: Any) -> Any:
            text = group_kernel.gpu_text(self.kernel.write, self.kernel.sizes, groups, rows, own)
            return run(text, GpuProgram("", self.kernel.name), groups * rows, operands, shapes)

        given = [leaf[None] for leaf in self.given(population, centres, count)]
        (made,) = self.kernel._call([*given, jnp.arange(CENTRES * GENOMES, dtype=jnp.int32)], call)
        return made.reshape(CENTRES, GENOMES)


WAYS = {"genome by genome": _Way(by_gene=False), "gene by gene": _Way(by_gene=True)}


@pytest.mark.parametrize("name", WAYS)
@settings(max_examples=20, deadline=None)
@given(genomes=st.lists(dags(activations=3), min_size=GENOMES, max_size=GENOMES), count=st.integers(0, CENTRES))
def test_all_distances_at_once_are_those_of_each_pair(name: str, genomes: list[Genome], count: int) -> None:
    """By a processor's kernel, a GPU's threads, and the function in jax; infinite to centres that do not count."""
    population, centres = stacked(genomes), stacked(genomes[1:])
    wanted = np.full((CENTRES, GENOMES), np.inf)
    for place in range(count):
        wanted[place] = [_weighted(one, genomes[1 + place]) for one in genomes]
    way = WAYS[name]
    given_ = way.given(population, centres, count)
    in_jax = [way.in_jax(*given_, jnp.int32(pair)) for pair in (0, 5, 11)]
    np.testing.assert_allclose(in_jax, wanted.ravel()[[0, 5, 11]], rtol=1e-5, atol=1e-6)
    for compute in (way.by_this_processor, way.by_a_gpus_threads):
        np.testing.assert_allclose(compute(population, centres, jnp.int32(count)), wanted, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("name", WAYS)
def test_trials_on_a_gpu_share_one_kernel_and_no_genome_is_copied_for_each_centre(name: str, tmp_path: Path) -> None:
    population = stacked([stacked([made([0, 1, 2], {(0, 2): 1.0})] * GENOMES)] * 2)
    (ptx,) = kernels_for_gpus(
        jax.vmap(WAYS[name].by_kernel), population, at(population, np.s_[:, :CENTRES]), np.int32([1, 2])
    )
    assert ".entry the_distances_of_genomes(" in ptx
    assemble(ptx, tmp_path)
