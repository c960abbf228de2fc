"""Evolution with other starts and champions: starts that individuals share, champions of one lucky episode."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace
from typing import ClassVar, Literal, get_args

import jax
import jax.numpy as jnp
from jax.custom_batching import sequential_vmap
from jaxtyping import Array, Int, PRNGKeyArray, UInt32

from evoclaims.core.errors import UserError, require_known
from evoclaims.core.foreign import implicit_promotions
from evoclaims.core.keys import streams
from evoclaims.core.pytree import pytree, select, strong
from evoclaims.envs.base import Episode, PolicyFn, Task, averaged
from evoclaims.methods import CmaEs, HyperNeat, MapElites, Neat, Policy, SeldomDecomposedCmaEs
from evoclaims.methods.base import Progress
from evoclaims.methods.cma_es import LARGE, CmaEsState
from evoclaims.methods.flat_champion import Champion, evaluate
from evoclaims.methods.map_elites import MapElitesState
from evoclaims.methods.neat.evolution import Evolution, GenomeMethod

Champions = Literal["evaluated_again", "best_ever"]


def with_shared_starts(task: Task, starts: PRNGKeyArray) -> Task:
    """Return the task with training episodes that are means over the same starts, whatever their own keys.

    Args:
        task: a task of this package, whose other functions stay.
        starts: keys of the starts, shape [starts].
    """

    def episode(policy: PolicyFn, key: PRNGKeyArray, level: Int[Array, ""]) -> Episode:
        if starts.shape == (1,):
            return task.episode(policy, starts[0], level)
        episodes: Episode = jax.vmap(lambda start: task.episode(policy, start, level))(starts)
        return averaged(episodes)

    shared = copy(task)
    object.__setattr__(shared, "episode", episode)  # tasks are frozen
    return shared


class _BestEver(GenomeMethod):
    """Keep the first genome whose one episode beat all before it on its level, as TensorNEAT does."""

    def step(
        self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: Evolution
    ) -> tuple[Evolution, Progress]:
        """Train for a generation, and keep the old champion unless the generation's best beats its episode."""
        after, progress = super().step(key, task, level, state)
        better = (after.episode.fitness > state.episode.fitness) | (level != state.level)
        champion, episode = select(better, (after.champion, after.episode), (state.champion, state.episode))
        metrics = {
            **progress.metrics,
            "champion_nodes": champion.node_count.astype(jnp.float32),
            "champion_connections": champion.connection_count.astype(jnp.float32),
        }
        return replace(after, champion=champion, episode=episode), replace(progress, metrics=metrics)


@dataclass(frozen=True)
class BestEverNeat(_BestEver, Neat):
    """NEAT whose champion is the first genome with the best episode of all generations on its level."""

    name: ClassVar[str] = "best_ever_neat"


@dataclass(frozen=True)
class BestEverHyperNeat(_BestEver, HyperNeat):
    """HyperNEAT whose champion is the first genome with the best episode of all generations on its level."""

    name: ClassVar[str] = "best_ever_hyperneat"


@dataclass(frozen=True)
class OtherCmaEs(CmaEs):
    """CMA-ES with common starts, or with a champion that is never evaluated again.

    Attributes:
        starts: of a generation, drawn anew for each, from which every individual runs an episode; 0 for one episode of
            each individual from a start of its own.
        champion: the best of the last generation and of the champion before, evaluated again; or the first with the
            best fitness of all generations, also of earlier levels ("best_ever").
    """

    name: ClassVar[str] = "other_cma_es"

    starts: int = 0
    champion: Champions = "evaluated_again"

    def __post_init__(self) -> None:
        """Check the numbers."""
        super().__post_init__()
        require_known("champion", self.champion, get_args(Champions))
        if self.starts < 0:
            raise UserError(f"A generation has 0 or more common starts, not {self.starts}.")

    def step(
        self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: CmaEsState
    ) -> tuple[CmaEsState, Progress]:
        """Train for a generation."""
        if self.starts:
            task = with_shared_starts(task, jax.random.split(streams(key, "common starts")[0], self.starts))
        if self.champion == "evaluated_again":
            return super().step(key, task, level, state)
        ask_key, episode_key, tell_key = streams(key, "ask", "episode", "tell")
        search, params = self._search(task)
        with implicit_promotions():
            ask = sequential_vmap(search.ask) if search.num_dims >= LARGE else search.ask
            population, distribution = ask(ask_key, state.distribution, params)
        episodes = evaluate(self.network, task, episode_key, level, population)
        with implicit_promotions():
            distribution, _ = search.tell(tell_key, population, -episodes.fitness, distribution, params)
        first = jnp.argmax(episodes.fitness)
        best = Champion(parameters=population[first], episode=jax.tree.map(lambda leaf: leaf[first], episodes))
        champion = select(best.episode.fitness > state.champion.episode.fitness, best, state.champion)
        finite = (jnp.all(jnp.isfinite(array)) for array in (episodes.fitness, population, distribution.mean))
        progress = Progress(
            fitness=best.episode.fitness,
            success=best.episode.success,
            healthy=jnp.all(jnp.stack(list(finite))),
            metrics={"step_size": distribution.std},
        )
        return CmaEsState(distribution=self._kept(strong(distribution)), champion=champion), progress

    def cost(self, task: Task) -> int:
        """Return the environment steps of one generation, at the longest episode, but for the champion's own."""
        return super().cost(task) * max(self.starts, 1)


@dataclass(frozen=True)
class OtherSeldomDecomposedCmaEs(OtherCmaEs, SeldomDecomposedCmaEs):
    """The same for networks of thousands of parameters."""

    name: ClassVar[str] = "other_seldom_decomposed_cma_es"
    packages: ClassVar[tuple[str, ...]] = SeldomDecomposedCmaEs.packages


@pytree
class OneStartState:
    """MAP-Elites' state, and the key of the start that all its individuals have."""

    inner: MapElitesState
    start: UInt32[Array, " words"]


@dataclass(frozen=True)
class OneStartMapElites(MapElites):
    """MAP-Elites in which all individuals of a trial have the same start."""

    name: ClassVar[str] = "one_start_map_elites"

    def init(self, key: PRNGKeyArray, task: Task) -> OneStartState:  # type: ignore[override]
        """Start with an empty archive, and draw the start."""
        return OneStartState(super().init(key, task), jax.random.key_data(streams(key, "start")[0]))

    def step(  # type: ignore[override]
        self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: OneStartState
    ) -> tuple[OneStartState, Progress]:
        """Draw or vary one batch, evaluate it from the one start, and put it into the archive."""
        shared = with_shared_starts(task, jax.random.wrap_key_data(state.start)[None])
        after, progress = super().step(key, shared, level, state.inner)
        return OneStartState(after, state.start), progress

    def best(self, task: Task, state: OneStartState) -> Policy:  # type: ignore[override]
        """Return the fittest elite; see `MapElites.best`."""
        return super().best(task, state.inner)
