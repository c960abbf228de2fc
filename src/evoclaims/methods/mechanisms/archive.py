"""MAP-Elites' archive against a table of the best that ever ended in each cell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray
from numpy.typing import NDArray

from evoclaims.envs.base import Episode, Task
from evoclaims.methods.flat_champion import policy_of
from evoclaims.methods.map_elites import MapElites, MapElitesState
from evoclaims.methods.mechanisms.observed import Observed, Question
from evoclaims.networks.mlp import Mlp

APART: Final = 10.0
"""Of the two parents of a line, in each parameter."""
LINE: Final = 0.1
"""The line_sigma of their variation."""
CHILDREN: Final = 1_024
"""So many that a tenth more or less shows in a trial: their "line" has a deviation of 0.04."""


@dataclass(frozen=True)
class Spread(Question):
    """An answer is a place, part of them outside the area, and the fitness there."""

    name: ClassVar[str] = "spread"
    packages: ClassVar[tuple[str, ...]] = MapElites.packages
    area: ClassVar[tuple[tuple[float, float], tuple[float, float]]] = ((-0.75, 0.75), (-0.25, 0.75))

    action_size: int = 3

    def reachable(self, cells: tuple[int, int]) -> NDArray[np.bool_]:
        """Return all cells."""
        return np.ones(cells, bool)

    def scored(self, answer: Float[Array, " action"]) -> Episode:
        """Return the third number as fitness, the first two as the place."""
        return Episode(fitness=answer[2], success=jnp.zeros(()), metrics={"x": answer[0], "y": answer[1]})


@dataclass(frozen=True)
class MapElitesMechanisms(Observed):
    """MAP-Elites whose archive is compared with what its elites do, and with the best of a batch in each cell.

    Metrics: "kept", the share of elites whose cell still has one at least as fit after the step; "true", the share of
    cells that hold what the elite itself earns and where it ends; "best", the share of cells that are right after one
    more batch of random networks; "near", how far new elites are from the nearest old one, in standard deviations of
    the noise on a parameter, root mean square over parameters; "line", how far children of two distant elites are from
    a parent on the line through both, as a share of what the variation's line_sigma says, root mean square.
    """

    revision: ClassVar[int] = 2

    of: MapElites = MapElites(network=Mlp(()), batch=64, initial=64, cells=(7, 5), iso_sigma=0.1, line_sigma=0.0)

    def seen(
        self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], before: Any, after: Any
    ) -> Mapping[str, Float[Array, ""]]:
        """Compare the archive after the step with tables that are made here."""
        assert isinstance(task, Spread)
        old, new = self.of.fitness_map(before), self.of.fitness_map(after)
        table = self._best(task, after.archive.genotypes, after.archive.fitnesses[:, 0] > -jnp.inf)
        batch = jax.random.normal(jax.random.fold_in(key, 1), (self.of.batch, after.archive.genotypes.shape[1]))
        inserted = self.of.fitness_map(self.of.insert(task, after, batch, self._episodes(task, batch)))
        return {
            "kept": jnp.mean((new >= old).astype(jnp.float32)),
            "true": jnp.mean((table == new).astype(jnp.float32)),
            "best": jnp.mean(jnp.maximum(new, self._best(task, batch, jnp.ones(batch.shape[0], bool))) == inserted),
            "near": self._distance(before.archive, after.archive),
            "line": self._along(jax.random.fold_in(key, 2), after),
        }

    def _episodes(self, task: Spread, vectors: Float[Array, "n parameters"]) -> Episode:
        shown = jnp.ones(task.observation_size)
        episodes: Episode = jax.vmap(lambda vector: task.scored(policy_of(self.of.network, task, vector)(shown)))(
            vectors
        )
        return episodes

    def _best(
        self, task: Spread, vectors: Float[Array, "n parameters"], counted: Bool[Array, " n"]
    ) -> Float[Array, "x y"]:
        """Return the best fitness in each cell; -inf where none ends."""
        episodes, cells = self._episodes(task, vectors), jnp.asarray(self.of.cells)
        low, high = jnp.asarray(task.area, jnp.float32).T
        place = jnp.stack([episodes.metrics["x"], episodes.metrics["y"]], axis=1)
        cell = jnp.floor((place - low) / (high - low) * cells).astype(jnp.int32)
        inside = jnp.all((cell >= 0) & (cell < cells), axis=1) & counted
        at = jnp.where(inside[:, None], cell, cells)  # writes beyond the table are dropped
        empty = jnp.full(self.of.cells, -jnp.inf)
        return empty.at[at[:, 0], at[:, 1]].max(episodes.fitness, mode="drop")

    def _along(self, key: PRNGKeyArray, state: MapElitesState) -> Float[Array, ""]:
        """Return the "line" of children of two elites: one at the origin, one at `APART` in each parameter.

        A half of them has two parents, in the mean. Nobody is so far from a parent as the other one is.
        """
        archive, size = state.archive, state.archive.genotypes.shape[1]
        two = jnp.arange(archive.fitnesses.shape[0]) < 2
        pair = archive.replace(
            genotypes=jnp.where(jnp.arange(two.size)[:, None] == 1, APART, jnp.zeros_like(archive.genotypes)),
            fitnesses=jnp.where(two[:, None], 0.0, -jnp.inf),
        )
        children = replace(self.of, line_sigma=LINE, batch=CHILDREN).vary(key, pair)
        along = jnp.mean(children, axis=1)  # of a parent 0 or APART
        moved = jnp.minimum(jnp.abs(along), jnp.abs(along - APART)) / APART
        noise = (self.of.iso_sigma / APART) ** 2 / size
        return jnp.sqrt(jnp.maximum(2 * (jnp.mean(moved**2) - noise), 0.0)) / LINE

    def _distance(self, before: Any, after: Any) -> Float[Array, ""]:
        """Return how far new elites are from the nearest old one; 0 while there is no old one."""
        lived = before.fitnesses[:, 0] > -jnp.inf
        apart = jnp.mean((after.genotypes[:, None] - before.genotypes[None]) ** 2, axis=2)
        nearest = jnp.min(jnp.where(lived[None], apart, jnp.inf), axis=1)
        fresh = (after.fitnesses[:, 0] > -jnp.inf) & (nearest > 0) & jnp.any(lived)
        total = jnp.sum(jnp.where(fresh, nearest, 0.0)) / jnp.maximum(jnp.sum(fresh), 1)
        return jnp.sqrt(total) / self.of.iso_sigma
