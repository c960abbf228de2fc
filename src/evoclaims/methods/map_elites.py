"""QDax's MAP-Elites (Mouret and Clune 2015, arXiv:1504.04909) over the position where a robot ends its episode."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any, ClassVar, Final, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray
from numpy.typing import NDArray

from evoclaims.core.errors import UserError, require_at_least
from evoclaims.core.foreign import implicit_promotions, imported_when_called
from evoclaims.core.keys import streams
from evoclaims.core.pytree import pytree, strong
from evoclaims.envs.base import Episode, Task, share
from evoclaims.methods.base import Policy, Progress
from evoclaims.methods.flat_champion import policy_of
from evoclaims.networks.mlp import Mlp

if TYPE_CHECKING:  # where it is used it is imported, which takes time
    from qdax.core.containers.mapelites_repertoire import MapElitesRepertoire
    from qdax.core.map_elites import MAPElites


@runtime_checkable
class MappedTask(Protocol):
    """A task with an area; its episodes' metrics hold "x" and "y", the robot's last position, in metres.

    They may also hold "reached": 1 when the robot reached the task's target.
    """

    @property
    def area(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Lowest and highest x, lowest and highest y, in metres."""

    def reachable(self, cells: tuple[int, int]) -> NDArray[np.bool_]:
        """Return which cells of a grid over the area the robot can reach, shape [cells along x, cells along y]."""


@pytree
class MapElitesState:
    """The archive and the progress so far.

    Attributes:
        archive: QDax's repertoire; genotypes [cells, parameters], fitnesses [cells, 1] (-inf without an elite),
            descriptors [cells, 2] in metres, and each elite's success [cells].
        evaluated: individuals evaluated so far.
        reached: 1 once any individual has reached the task's target, else 0.
        level: of the elites; None where the task has one level.
    """

    archive: Any
    evaluated: Int[Array, ""]
    reached: Float[Array, ""]
    level: Int[Array, ""] | None = None


_LOWEST: Final = float(np.finfo(np.float32).min)


@dataclass(frozen=True)
class MapElites:
    """QDax's MAP-Elites with iso+line variation of uniformly drawn elites (Vassiliades and Mouret 2018, GECCO).

    The descriptor is where the episode ended, on a euclidean grid over the task's area. The first batches are drawn as
    in QDax's examples: LeCun-uniform weights, zero biases. An individual that is not finite or ends outside the area
    counts as evaluated, but is dropped. Where the level has changed, the map is emptied, since its fitnesses are of
    another level; the first to enter it again are the old elites' children.

    Attributes:
        network: the policy's network, whose weights and biases are evolved.
        batch: individuals per iteration.
        cells: cells of the grid along x and along y.
        iso_sigma: standard deviation of the noise on every parameter.
        line_sigma: standard deviation of the step along the line to another elite, as a share of the distance.
        initial: individuals drawn at random before the first variation, rounded up to whole batches.
    """

    name: ClassVar[str] = "map_elites"
    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ("qdax",)

    network: Mlp = Mlp((32,) * 4)
    batch: int = 100
    cells: tuple[int, int] = (50, 50)
    iso_sigma: float = 0.005
    line_sigma: float = 0.05
    initial: int = 100

    def __post_init__(self) -> None:
        """Check the sizes and standard deviations."""
        if not isinstance(self.network, Mlp):
            raise UserError(f"MAP-Elites has network={self.network!r}. Write an Mlp, such as Mlp((8,)).")
        require_at_least(1, "MAP-Elites's", batch=self.batch, initial=self.initial)
        if len(self.cells) != 2 or min(self.cells) < 1:
            raise UserError(f"MAP-Elites has cells={self.cells}. Write two numbers of at least 1.")
        spreads = (self.iso_sigma, self.line_sigma)
        if not all(math.isfinite(sigma) and sigma >= 0 for sigma in spreads) or sum(spreads) == 0:
            raise UserError(
                f"MAP-Elites has iso_sigma={self.iso_sigma} and line_sigma={self.line_sigma}. Write finite standard "
                "deviations of at least 0, one of them above 0."
            )

    def init(self, key: PRNGKeyArray, task: Task) -> MapElitesState:
        """Start with an empty archive; the key is not used.

        Raises:
            UserError: for a task without an area to map.
        """
        repertoire = _repertoire()
        (x_min, x_max), (y_min, y_max) = _mapped(task).area
        size = self.network.size(task.observation_size, task.action_size)
        with implicit_promotions():
            archive = repertoire.MapElitesRepertoire.init_default(
                jnp.zeros(size),
                repertoire.compute_euclidean_centroids(self.cells, [x_min, y_min], [x_max, y_max]),
                one_extra_score={"success": jnp.zeros(())},
                keys_extra_scores=("success",),
            )
        return MapElitesState(
            archive=strong(archive),
            evaluated=jnp.zeros((), jnp.int32),
            reached=jnp.zeros((), jnp.float32),
            level=jnp.zeros((), jnp.int32) if task.levels > 1 else None,
        )

    def step(
        self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: MapElitesState
    ) -> tuple[MapElitesState, Progress]:
        """Draw or vary one batch, evaluate it and put it into the archive.

        Metrics: "coverage" (share of the reachable cells that hold an elite), "elites" (how many there are) and
        "reached" (see `MapElitesState`). Fitness and success are the best elite's; without elites, the lowest
        number and 0.

        Raises:
            UserError: when the task's episodes do not report where they end.
        """
        draw_key, vary_key, episode_key = streams(key, "draw", "vary", "episode")
        drawn = lecun_uniform(draw_key, self.network, task.observation_size, task.action_size, self.batch)
        population = jnp.where(state.evaluated < self.initial, drawn, self.vary(vary_key, state.archive))
        known = _of_level(state, level)
        after = self.insert(task, known, population, self._evaluate(task, episode_key, level, population))
        # All elites come from checked batches.
        return after, self._progress(task, after, healthy=jnp.all(jnp.isfinite(population)))

    def vary(self, key: PRNGKeyArray, archive: MapElitesRepertoire) -> Float[Array, "batch parameters"]:
        """Return children of the archive's elites."""
        with implicit_promotions():
            children: Float[Array, "batch parameters"] = self._algorithm().ask(archive, None, key)[0]
        return children

    def insert(
        self, task: Task, state: MapElitesState, population: Float[Array, "batch parameters"], episodes: Episode
    ) -> MapElitesState:
        """Return the state after a batch with the given episodes, leaves [batch].

        An individual becomes its cell's elite when it is fitter than the old one; within a batch, the first best one.
        """
        descriptors = jnp.stack([episodes.metrics["x"], episodes.metrics["y"]], axis=-1)
        low, high = jnp.asarray(_mapped(task).area, jnp.float32).T
        inside = jnp.all((descriptors >= low[None]) & (descriptors <= high[None]), axis=1)  # NaN is not
        valid = inside & jnp.isfinite(episodes.fitness)
        fitness = jnp.where(valid, episodes.fitness, -jnp.inf)
        with implicit_promotions():
            cell = _repertoire().get_cells_indices(descriptors, state.archive.centroids)
            fitness = jnp.where(beaten(cell, fitness), -jnp.inf, fitness)
            archive, _, _ = self._algorithm().tell(
                population, fitness, descriptors, state.archive, None, {"success": episodes.success}
            )
        reached = valid & (episodes.metrics.get("reached", jnp.zeros(self.batch)) == 1)
        return MapElitesState(
            archive=strong(archive),
            evaluated=state.evaluated + self.batch,
            reached=jnp.maximum(state.reached, jnp.any(reached).astype(jnp.float32)),
            level=state.level,
        )

    def best(self, task: Task, state: MapElitesState) -> Policy:
        """Return the fittest elite; its parameters are (its vector, the map of all elites' fitnesses).

        The policy does not use the map (see `fitness_map`): it is there to be stored with the champion.
        """
        elite = jnp.argmax(state.archive.fitnesses)
        return Policy(
            parameters=(state.archive.genotypes[elite], self.fitness_map(state)),
            function=lambda parameters, observation: self.network.apply(parameters[0], observation, task.action_size),
        )

    def used(self, parameters: Any) -> Any:
        """Return the elite's vector; not the map, which is -inf where there is no elite."""
        return parameters[0]

    def cost(self, task: Task) -> int:
        """Return the environment steps of one iteration, at the longest episode."""
        return self.batch * task.horizon

    def fitness_map(self, state: MapElitesState) -> Float[Array, "x y"]:
        """Return the elites' fitnesses, shape [cells along x, cells along y]; -inf without an elite."""
        along_x, along_y = self.cells
        # In QDax's cell index, x varies fastest.
        fitnesses: Float[Array, "x y"] = state.archive.fitnesses.reshape(along_y, along_x).T
        return fitnesses

    def _algorithm(self) -> MAPElites:
        """Build QDax's algorithm for ask and tell: it evaluates nothing itself."""
        _repertoire()
        from qdax.core.emitters.mutation_operators import isoline_variation
        from qdax.core.emitters.standard_emitters import MixingEmitter
        from qdax.core.map_elites import MAPElites

        variation = partial(isoline_variation, iso_sigma=self.iso_sigma, line_sigma=self.line_sigma)
        emitter = MixingEmitter(
            mutation_fn=None, variation_fn=variation, variation_percentage=1.0, batch_size=self.batch
        )
        return MAPElites(scoring_function=None, emitter=emitter, metrics_function=lambda _: {})

    def _evaluate(
        self, task: Task, key: PRNGKeyArray, level: Int[Array, ""], population: Float[Array, "batch parameters"]
    ) -> Episode:
        """Run one episode per individual, leaves [batch]."""
        keys = jax.random.split(key, self.batch)
        episodes = jax.vmap(lambda p, k: task.episode(policy_of(self.network, task, p), k, level))(population, keys)
        if not {"x", "y"} <= set(episodes.metrics):
            known = ", ".join(sorted(episodes.metrics)) or "none"
            raise UserError(
                f'MAP-Elites maps episodes by their metrics "x" and "y", which {task.name!r} lacks (it has: '
                f"{known}). Add them to its episodes."
            )
        return episodes

    def _progress(self, task: Task, state: MapElitesState, healthy: Bool[Array, ""]) -> Progress:
        archive, fitnesses = state.archive, self.fitness_map(state)
        elite = jnp.argmax(archive.fitnesses)
        filled = fitnesses > -jnp.inf
        ground = _mapped(task).reachable(self.cells)
        return Progress(
            fitness=jnp.maximum(archive.fitnesses[elite, 0], _LOWEST),  # -inf would be divergence
            success=archive.extra_scores["success"][elite],
            healthy=healthy,
            metrics={
                "coverage": share(jnp.sum(filled & ground), jnp.asarray(ground.sum(), jnp.int32)),
                "elites": jnp.sum(filled).astype(jnp.float32),
                "reached": state.reached,
            },
        )


def _of_level(state: MapElitesState, level: Int[Array, ""]) -> MapElitesState:
    """Return the state without the elites of another level."""
    if state.level is None:
        return state
    same, archive = state.level == level, state.archive
    kept = archive.replace(
        fitnesses=jnp.where(same, archive.fitnesses, -jnp.inf),
        extra_scores={name: jnp.where(same, scores, 0.0) for name, scores in archive.extra_scores.items()},
    )
    return replace(state, archive=kept, level=level)


def lecun_uniform(
    key: PRNGKeyArray, network: Mlp, inputs: int, outputs: int, count: int
) -> Float[Array, "count parameters"]:
    """Draw perceptrons: weights from U(-√(3 / fan-in), √(3 / fan-in)) (LeCun et al. 1998), biases 0."""
    widths, bounds = (inputs, *network.layers, outputs), []
    for depth, (fan_in, fan_out) in enumerate(pairwise(widths), start=1):
        last = depth == len(widths) - 1
        feeding = fan_in + inputs * (network.skip and last)
        bounds += [np.full(fan_in * fan_out, np.sqrt(3 / feeding)), np.zeros(fan_out)]
        if network.skip and last:
            bounds.append(np.full(inputs * fan_out, np.sqrt(3 / feeding)))
    bound = np.concatenate(bounds).astype(np.float32)
    return jax.random.uniform(key, (count, bound.size), minval=-1.0, maxval=1.0) * bound[None]


def beaten(cell: Int[Array, " batch"], fitness: Float[Array, " batch"]) -> Bool[Array, " batch"]:
    """Return which individuals are not the first of the fittest of the batch in their cell.

    QDax writes all tied individuals into the cell, in no guaranteed order on an accelerator: the elite could get one
    individual's genotype and another's descriptor.
    """
    index = jnp.arange(cell.shape[0])
    fitter = fitness[None, :] > fitness[:, None]
    earlier = (fitness[None, :] == fitness[:, None]) & (index[None, :] < index[:, None])
    return jnp.any((cell[None, :] == cell[:, None]) & (fitter | earlier), axis=1)


def _repertoire() -> Any:
    """Import QDax's module of archives without scikit-learn, for which it has no use here: 110 MB and a second."""
    with imported_when_called("sklearn.cluster", "KMeans"):
        from qdax.core.containers import mapelites_repertoire
    return mapelites_repertoire


def _mapped(task: Task) -> MappedTask:
    if not isinstance(task, MappedTask):
        raise UserError(
            f"MAP-Elites maps where episodes end, and the task {task.name!r} has no area to map. Use a task with "
            "`area` and `reachable`, such as a maze."
        )
    return task
