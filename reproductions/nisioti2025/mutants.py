"""Faults that only this paper's methods and tasks can have; its claims should notice them (`evoclaims mutants`)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import jax
import jax.numpy as jnp

from evoclaims.envs import Box, DeceptiveMaze, Obstacles, Rangefinders, Ruling, SteppingStones
from evoclaims.methods import HandBuilt, HyperNeat, Neat, Policy, Ppo, RandomPolicy
from evoclaims.methods.mechanisms import (
    CmaEsMechanisms,
    HyperNeatMechanisms,
    MapElitesMechanisms,
    NeatMechanisms,
    PpoMechanisms,
    Room,
)
from evoclaims.methods.neat import Attribute, Mutation
from evoclaims.mutants import Fault, Mutant, of_method, of_task, plant, with_method, with_task
from evoclaims.networks import Substrate
from reproductions.nisioti2025 import ecorobot
from reproductions.nisioti2025.waypoints import Waypoints

MAZES = (SteppingStones, DeceptiveMaze)


def _with_mutation(method: Any, mutation: Mutation) -> Any:
    """Return NEAT or HyperNEAT with other mutations."""
    return replace(method, settings=replace(method.settings, mutation=mutation))


def _growing_nothing(method: Any) -> Any:
    """NEAT that never changes a network's structure."""
    structure = dict.fromkeys(("node_add", "node_delete", "connection_add", "connection_delete"), 0.0)
    return _with_mutation(method, replace(method.settings.mutation, **structure))


def _keeping_values(method: Any) -> Any:
    """NEAT or HyperNEAT that never changes a weight, a bias or a response."""
    mutation = method.settings.mutation

    def frozen(attribute: Attribute) -> Attribute:
        return replace(attribute, mutate_rate=0.0, replace_rate=0.0)

    values = {name: frozen(getattr(mutation, name)) for name in ("weight", "bias", "response")}
    return _with_mutation(method, replace(mutation, **values))


def _in_a_point(method: Any) -> Any:
    """HyperNEAT whose neurons all lie at one point, so that the CPPN gives every connection the same weight."""
    if method.substrate is None:
        return method
    return replace(method, substrate=Substrate(tuple(((0.0, 0.0),) * len(layer) for layer in method.substrate.layers)))


def _learning(one: Any) -> Any:
    """A baseline that has learnt: instead of a random policy NEAT, or where NEAT is not run, PPO.

    With one report less than the learner that claims compare it with, it has trials of its own.
    """
    if not isinstance(one.method, RandomPolicy):
        return None
    for conditions in (ecorobot.SMOKE, ecorobot.FULL):
        for (_, task), other in conditions.items():
            if other.id == one.id:
                learner = conditions.get(("neat", task)) or conditions["ppo", task]
                return replace(learner, budget=replace(learner.budget, reports=learner.budget.reports - 1))
    return None


class AnswersTheOpposite(Fault):
    """A circuit built by hand whose outputs are negated; the negated one's are not."""

    says: ClassVar[str] = "answers the opposite"

    def best(self, task: Any, state: Any) -> Policy:
        """Return the other circuit."""
        policy: Policy = replace(self.sound, negated=not self.sound.negated).best(task, state)
        return policy


class StonesPayNothing(Fault):
    """Stepping stones whose reward is the nearness of the next stone alone."""

    says: ClassVar[str] = "pays nothing for stones"

    def rule(self, memory: Any, before: Any, after: Any, action: Any) -> Ruling:
        """Take the stones' reward, and the bonus of the last one, off a step's."""
        ruling: Ruling = self.sound.rule(memory, before, after, action)
        return replace(ruling, reward=jnp.minimum(ruling.reward - ruling.memory.crossed, 1.0))


class StonesUncounted(Fault):
    """Stepping stones that the rule never counts as crossed."""

    says: ClassVar[str] = "counts no stone"

    def rule(self, memory: Any, before: Any, after: Any, action: Any) -> Ruling:
        """Keep the count as it was."""
        ruling: Ruling = self.sound.rule(memory, before, after, action)
        return replace(ruling, memory=memory)


class WallsUnderground(Fault):
    """A maze whose walls lie under the floor, so that robots pass."""

    says: ClassVar[str] = "has no walls"

    @property
    def boxes(self) -> tuple[Box, ...]:
        """The walls, all of them below the floor."""
        return tuple(replace(box, bottom=-3.0, top=-2.0) for box in self.sound.boxes)


class FlatObstacles(Fault):
    """Obstacles that do not rise above the floor."""

    says: ClassVar[str] = "has flat obstacles"

    @property
    def tops(self) -> tuple[float, ...]:
        """Height of each obstacle, m."""
        return (0.0,) * len(self.sound.tops)


class TargetFromAfar(Fault):
    """A deceptive maze that counts its target as reached from the other side of the wall."""

    says: ClassVar[str] = "reaches its target from afar"

    @property
    def plan(self) -> Any:
        """The maze, with a target of 4 m around its place."""
        return self.sound.plan._replace(within=4.0)


@dataclass(frozen=True)
class _Unseeing(Rangefinders):
    """Rays that never meet anything."""

    def read(self, scene: Any, pose: Any) -> Any:
        """Return 1 for every ray."""
        return jnp.ones(self.count)


@dataclass(frozen=True)
class _Turned(Rangefinders):
    """Rays in the other order."""

    def read(self, scene: Any, pose: Any) -> Any:
        """Return the sound readings from the last to the first."""
        return super().read(scene, pose)[::-1]


def _with_rays(says: str, kind: type[Rangefinders], only: type | tuple[type, ...]) -> Mutant:
    """Return the mutant whose robot has other rays, as many and as long as the sound one's."""
    return with_task(says, lambda task: replace(task, sensor=kind(task.sensor.count, task.sensor.reach)), only)


class DropsAFrame(Fault):
    """A robot's task whose steps are a frame shorter than the robot says."""

    says: ClassVar[str] = "drops a frame of each step"

    def plain_step(self, state: Any, action: Any) -> Any:
        """Take a step of a robot with a frame less."""
        robot = replace(self.sound.robot, frames=self.sound.robot.frames - 1)
        return replace(self.sound, robot=robot).with_numbers(self.sound.places).plain_step(state, action)


class LearnsNoCovariance(Fault):
    """CMA-ES that keeps the covariance of its first generation."""

    says: ClassVar[str] = "learns no covariance"

    def step(self, key: Any, task: Any, level: Any, state: Any) -> Any:
        """Take a step, and restore the covariance."""
        after, progress = self.sound.step(key, task, level, state)
        return replace(after, distribution=after.distribution.replace(C=state.distribution.C)), progress


class PrefersNewElites(Fault):
    """MAP-Elites in whose archive any newcomer replaces an elite."""

    says: ClassVar[str] = "prefers new elites"

    def insert(self, task: Any, state: Any, population: Any, episodes: Any) -> Any:
        """Insert a batch into an archive whose elites are all beaten, and restore what is left of them."""
        fitnesses = state.archive.fitnesses
        beaten = jnp.where(fitnesses > -jnp.inf, -1e30, -jnp.inf)
        archive = state.archive.replace(fitnesses=beaten)
        after = self.sound.insert(task, replace(state, archive=archive), population, episodes)
        kept = jnp.where(after.archive.fitnesses == -1e30, fitnesses, after.archive.fitnesses)
        return replace(after, archive=after.archive.replace(fitnesses=kept))


class WeighsAllParentsAlike(Fault):
    """CMA-ES whose better half all has the same weight in the next mean and covariance."""

    says: ClassVar[str] = "weighs all parents alike"

    def _search(self, task: Any) -> Any:
        """Return evosax's algorithm with other weights."""
        search, params = self.sound._search(task)
        better = params.weights > 0
        return search, params.replace(weights=jnp.where(better, 1 / jnp.sum(better), params.weights))


class SwapsParents(Fault):
    """NEAT whose children have the structure of the parent that is less fit."""

    says: ClassVar[str] = "takes structure from the other parent"

    def parents(self, *chosen_from: Any) -> Any:
        """Return the parents in the wrong order."""
        chosen = self.sound.parents(*chosen_from)
        return replace(chosen, fitter=chosen.other, other=chosen.fitter)


class RepeatsAMinibatch(Fault):
    """PPO that learns from the first trajectories alone."""

    says: ClassVar[str] = "learns from one minibatch"

    def _train(self, key: Any, task: Any, data: Any, *rest: Any) -> Any:
        """Train on copies of the first minibatch."""

        def copied(leaf: Any) -> Any:
            return jnp.concatenate([leaf[: self.sound.batch_size]] * self.sound.minibatches)

        return self.sound._train(key, task, jax.tree.map(copied, data), *rest)


class ForgetsStatistics(Fault):
    """PPO that whitens observations by those of its last step alone."""

    says: ClassVar[str] = "forgets what it saw"

    def step(self, key: Any, task: Any, level: Any, state: Any) -> Any:
        """Take a step with fresh statistics."""
        fresh = self.sound.init(key, task).statistics
        return self.sound.step(key, task, level, replace(state, statistics=fresh))


class KeepsOrder(Fault):
    """PPO that divides trajectories into minibatches in their order."""

    says: ClassVar[str] = "never shuffles"

    def division(self, key: Any) -> Any:
        """Return the trajectories in their order."""
        return jnp.sort(self.sound.division(key).ravel()).reshape(self.sound.minibatches, -1)


def _trained_with(says: str, **changes: float) -> Mutant:
    """Return the mutant in which the observed PPO trains with other numbers than it has."""

    def train(self: Any, *given: Any) -> Any:
        return replace(self.sound, **changes)._train(*given)

    fault: Any = type("TrainsWith", (Fault,), {"says": says, "_train": train})
    return _observed(fault, PpoMechanisms)


class DrawsElsewhere(Fault):
    """HyperNEAT that asks its CPPN for each layer's neurons from right to left."""

    says: ClassVar[str] = "draws weights at the wrong neurons"

    def encoding(self, task: Any) -> Any:
        """Return the encoding with each layer reversed."""
        sound = self.sound.encoding(task)
        return replace(sound, substrate=Substrate(tuple(layer[::-1] for layer in sound.substrate.layers)))


class DrawsNearThreshold(Fault):
    """HyperNEAT that draws weights beyond a threshold that is a tenth lower."""

    says: ClassVar[str] = "has another threshold"

    def encoding(self, task: Any) -> Any:
        """Return the encoding with another threshold."""
        sound = self.sound.encoding(task)
        return replace(sound, threshold=0.9 * sound.threshold)


class DrawsSmallWeights(Fault):
    """HyperNEAT whose weights are a tenth smaller."""

    says: ClassVar[str] = "draws smaller weights"

    def encoding(self, task: Any) -> Any:
        """Return the encoding with a smaller range."""
        sound = self.sound.encoding(task)
        return replace(sound, max_weight=0.9 * sound.max_weight)


class DrawsInAPoint(Fault):
    """HyperNEAT whose neurons all lie at one point, wherever they should."""

    says: ClassVar[str] = "draws in a point"

    def encoding(self, task: Any) -> Any:
        """Return the encoding with all neurons in the middle."""
        sound = self.sound.encoding(task)
        layers = sound.substrate.layers
        return replace(sound, substrate=Substrate(tuple(((0.0, 0.0),) * len(layer) for layer in layers)))


def _with_species(says: str, **changes: Any) -> Mutant:
    """Return the mutant that divides the observed NEAT otherwise into species."""

    def changed(one: Any) -> Any:
        if not isinstance(one.method, NeatMechanisms):
            return None
        settings = one.method.of.settings
        species = replace(settings.species, **changes)
        return replace(one, method=replace(one.method, of=Neat(replace(settings, species=species))))

    return Mutant(says, "method", changed)


def _observed(fault: type[Fault], kind: type) -> Mutant:
    """Return the mutant that plants a fault in the method that a method of a class observes."""

    def changed(one: Any) -> Any:
        observer = one.method
        return (
            replace(one, method=replace(observer, of=plant(fault, observer.of))) if isinstance(observer, kind) else None
        )

    return Mutant(fault.says, "method", changed)


MUTANTS = {
    "baseline-has-learnt": Mutant("has learnt", "method", _learning),
    "answers-the-opposite": of_method(AnswersTheOpposite, only=HandBuilt),
    "stands-still": with_method("stands still", lambda method: replace(method, speed=0.0), only=Waypoints),
    "learning-rate-0": with_method(
        "has a learning rate of 0", lambda method: replace(method, learning_rate=0.0), only=Ppo
    ),
    "grows-nothing": with_method("never changes structure", _growing_nothing, only=Neat),
    "keeps-values": with_method("never changes values", _keeping_values, only=(Neat, HyperNeat)),
    "substrate-in-a-point": with_method("has its neurons in a point", _in_a_point, only=HyperNeat),
    "stones-pay-nothing": of_task(StonesPayNothing, only=SteppingStones),
    "stones-uncounted": of_task(StonesUncounted, only=SteppingStones),
    "stones-from-afar": with_task(
        "counts stones from 1 m away", lambda task: replace(task, within=1.0), only=SteppingStones
    ),
    "no-walls": of_task(WallsUnderground, only=MAZES),
    "unseeing-rays": _with_rays("has rays that see nothing", _Unseeing, only=(*MAZES, Room)),
    "turned-rays": _with_rays("has rays from left to right", _Turned, only=Room),
    "drops-a-frame": of_task(DropsAFrame, only=Room),
    "selects-anybody": _with_species("lets anybody have offspring", survival=1.0),
    "one-parent": _with_species("has one parent in each species", survival=0.01),
    "endless-patience": _with_species("never lets a species die", stagnation=1_000),
    "no-elites": _with_species("keeps no elites", elites=0),
    "little-patience": _with_species("lets a species die after three generations", stagnation=3),
    "swaps-parents": _observed(SwapsParents, NeatMechanisms),
    "learns-no-covariance": _observed(LearnsNoCovariance, CmaEsMechanisms),
    "weighs-parents-alike": _observed(WeighsAllParentsAlike, CmaEsMechanisms),
    "prefers-new-elites": _observed(PrefersNewElites, MapElitesMechanisms),
    "other-discount": _trained_with("discounts by a tenth more", discounting=0.81),
    "other-trace": _trained_with("has another λ", gae_lambda=0.72),
    "other-learning-rate": _trained_with("has another learning rate", learning_rate=0.018),
    "other-bounds": _trained_with("clips elsewhere", clipping=0.3),
    "other-entropy-cost": _trained_with("has no entropy", entropy_cost=0.0),
    "unscaled-rewards": _trained_with("scales no reward", reward_scaling=1.0),
    "repeats-a-minibatch": _observed(RepeatsAMinibatch, PpoMechanisms),
    "keeps-order": _observed(KeepsOrder, PpoMechanisms),
    "forgets-statistics": _observed(ForgetsStatistics, PpoMechanisms),
    "draws-elsewhere": _observed(DrawsElsewhere, HyperNeatMechanisms),
    "draws-in-a-point": _observed(DrawsInAPoint, HyperNeatMechanisms),
    "other-threshold": _observed(DrawsNearThreshold, HyperNeatMechanisms),
    "smaller-weights": _observed(DrawsSmallWeights, HyperNeatMechanisms),
    "flat-obstacles": of_task(FlatObstacles, only=Obstacles),
    "target-from-afar": of_task(TargetFromAfar, only=DeceptiveMaze),
}
