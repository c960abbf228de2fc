"""The three programs of a condition: start, advance, examine."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from evoclaims.core.keys import EVALUATION, TRAINING, streams, trial_key
from evoclaims.core.pytree import pytree, select, strong
from evoclaims.envs.base import Episode, Numbered, PolicyFn, Task
from evoclaims.kernels import kernel_prng
from evoclaims.methods.base import Progress, Resizable
from evoclaims.trials.compatibility import both_named, check_scores, traced_progress
from evoclaims.trials.spec import Condition

NEVER = -1


@pytree
class Ascent:
    """A trial's position in its task's levels.

    Attributes:
        level: the current training level.
        solved_at: for each level, the number of method steps when it was first solved, or `NEVER`.
        finished: whether the last level is solved.
    """

    level: Int[Array, ""]
    solved_at: Int[Array, " levels"]
    finished: Bool[Array, ""]


def start(levels: int, progression: Any) -> Ascent:
    """Begin at level 0 ("curriculum") or at the last ("direct", "whole_budget")."""
    first = {"curriculum": 0, "direct": levels - 1, "whole_budget": levels - 1}[progression]
    return Ascent(
        level=jnp.array(first, jnp.int32),
        solved_at=jnp.full((levels,), NEVER, jnp.int32),
        finished=jnp.zeros((), bool),
    )


def climb(ascent: Ascent, success: Float[Array, ""], steps: Int[Array, ""]) -> Ascent:
    """Move up one level when `success` is exactly 1 after `steps` steps; finish when the last is solved."""
    last = ascent.solved_at.shape[0] - 1
    solved = success == 1.0
    before = ascent.solved_at[ascent.level]
    return Ascent(
        level=jnp.minimum(ascent.level + solved.astype(jnp.int32), last),
        solved_at=ascent.solved_at.at[ascent.level].set(jnp.where(solved & (before == NEVER), steps, before)),
        finished=ascent.finished | (solved & (ascent.level == last)),
    )


def examine_every_level(task: Task, policy: PolicyFn, key: PRNGKeyArray) -> Episode:
    """Examine a policy on each level separately; the leaves of the result have shape [levels].

    The key must come from the trial's evaluation stream, which training never draws from.
    """
    levels = jnp.arange(task.levels, dtype=jnp.int32)
    keys = jax.random.split(key, task.levels)
    return jax.vmap(lambda k, level: task.examine(policy, k, level))(keys, levels)


@pytree
class TrialState:
    """Everything a trial needs to continue; a checkpoint holds it, stacked over trials.

    Attributes:
        seed: the trial's seed; all its keys derive from it.
        method: the method's own state.
        ascent: its position in the levels.
        steps: steps of the method taken.
        last: what the last step reported.
        diverged: whether a number is no longer finite.
        idle: True for a lane that only fills the batch, or whose trial has ended and been examined.
        numbers: the task's numbers, if it has any (`Numbered`).
    """

    seed: Int[Array, ""]
    method: Any
    ascent: Ascent
    steps: Int[Array, ""]
    last: Progress
    diverged: Bool[Array, ""]
    idle: Bool[Array, ""]
    numbers: Any


@pytree
class Report:
    """What the host reads after each call: small scalars per trial."""

    steps: Int[Array, ""]
    level: Int[Array, ""]
    fitness: Float[Array, ""]
    success: Float[Array, ""]
    metrics: Mapping[str, Float[Array, ""]]
    ended: Bool[Array, ""]
    diverged: Bool[Array, ""]


@pytree
class Score:
    """What the host reads from a trial that has ended.

    Attributes:
        final: the champion's episodes, leaves [levels].
        parameters: the champion's parameters.
        solved_at: see `Ascent`.
    """

    final: Episode
    parameters: Any
    solved_at: Int[Array, " levels"]


@dataclass(frozen=True)
class Program:
    """The pure functions of one condition, for a single trial unless they say otherwise."""

    condition: Condition

    def start(self, seed: Int[Array, ""], idle: Bool[Array, ""]) -> TrialState:
        """Build the state of a trial that has not taken a step.

        Raises:
            UserError: when method and task do not fit together (see `compatibility.traced_progress`).
        """
        progress = self._progress
        method, task = self.condition.method, self.condition.task
        init_key = streams(kernel_prng(trial_key(seed, TRAINING)), "init")[0]
        return TrialState(
            seed=seed,
            method=strong(method.init(init_key, task)),
            ascent=start(task.levels, self.condition.progression),
            steps=jnp.zeros((), jnp.int32),
            last=jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), progress),
            diverged=jnp.zeros((), bool),
            idle=idle,
            numbers=jax.tree.map(jnp.asarray, task.numbers) if isinstance(task, Numbered) else (),
        )

    def advance(self, trial: TrialState, until: Int[Array, ""]) -> tuple[TrialState, Report]:
        """Take steps until the trial has ended or has taken `until` of them."""
        step = partial(self._step, _training_key(trial), self._task(trial))
        trial = jax.lax.while_loop(lambda trial: self._running(trial, until), step, trial)
        return trial, self._report(trial)

    def advance_together(self, trials: TrialState, until: Int[Array, " trials"]) -> tuple[TrialState, Report]:
        """Advance trials side by side until the first ends or all have taken `until` steps; leaves [trials].

        Whoever calls must then examine a trial that has ended, and make its lane idle. An idle lane keeps all but its
        method's state: to keep that, too, would move whole populations at every step.
        """
        method = self.condition.method
        keys = jax.vmap(_training_key)(trials)

        def all_run(trials: TrialState) -> Bool[Array, ""]:
            return ~jnp.all(trials.idle) & jnp.all(trials.idle | jax.vmap(self._running)(trials, until))

        def step(trials: TrialState) -> TrialState:
            return jax.vmap(step_or_stay)(keys, trials)

        def step_or_stay(key: PRNGKeyArray, trial: TrialState) -> TrialState:
            stepped = self._step(key, self._task(trial), trial)
            small = select(trial.idle, replace(trial, method=()), replace(stepped, method=()))
            return replace(small, method=stepped.method)

        if isinstance(method, Resizable):
            trials = _in_sizes(method, self.condition.task, step, all_run, trials)
        else:
            trials = jax.lax.while_loop(all_run, step, trials)
        return trials, jax.vmap(self._report)(trials)

    def examine(self, trial: TrialState) -> Score:
        """Examine the trial's champion on every level, with keys that training never sees."""
        method, task = self.condition.method, self._task(trial)
        policy = method.best(task, trial.method)
        with both_named(method, task):
            final = examine_every_level(task, policy, kernel_prng(trial_key(trial.seed, EVALUATION)))
            check_scores(task, final)
        return Score(final=final, parameters=policy.parameters, solved_at=trial.ascent.solved_at)

    @cached_property
    def _progress(self) -> Progress:
        """The shapes of what a step reports; cached, since tracing a step takes seconds."""
        return traced_progress(self.condition.method, self.condition.task)

    def _step(self, training_key: PRNGKeyArray, task: Task, trial: TrialState) -> TrialState:
        # The key depends on seed and step alone: a trial that continues from a checkpoint draws the same numbers.
        key = jax.random.fold_in(training_key, trial.steps)
        state, progress = self.condition.method.step(key, task, trial.ascent.level, trial.method)
        steps = trial.steps + 1
        healthy = progress.healthy & jnp.isfinite(progress.fitness) & jnp.isfinite(progress.success)
        # A step that diverged never solves a level: its success may come from numbers that are not finite.
        return replace(
            trial,
            method=strong(state),
            ascent=climb(trial.ascent, jnp.where(healthy, progress.success, 0.0), steps),
            steps=steps,
            last=strong(progress),
            diverged=~healthy,
        )

    def _report(self, trial: TrialState) -> Report:
        return Report(
            steps=trial.steps,
            level=trial.ascent.level,
            fitness=trial.last.fitness,
            success=trial.last.success,
            metrics=trial.last.metrics,
            ended=self._ended(trial),
            diverged=trial.diverged,
        )

    def _task(self, trial: TrialState) -> Task:
        task = self.condition.task
        return task.with_numbers(trial.numbers) if isinstance(task, Numbered) else task

    def _running(self, trial: TrialState, until: Int[Array, ""]) -> Bool[Array, ""]:
        return ~self._ended(trial) & (trial.steps < until)

    def _ended(self, trial: TrialState) -> Bool[Array, ""]:
        done = trial.diverged | trial.idle | (trial.steps >= self.condition.steps)
        return done if self.condition.progression == "whole_budget" else done | trial.ascent.finished


def _training_key(trial: TrialState) -> PRNGKeyArray:
    return streams(kernel_prng(trial_key(trial.seed, TRAINING)), "step")[0]


def _in_sizes(
    method: Resizable,
    task: Task,
    step: Callable[[TrialState], TrialState],
    go_on: Callable[[TrialState], Array],
    trials: TrialState,
) -> TrialState:
    """Let trials step while they `go_on`, in the smallest arrays that all of them fit: a loop for each size.

    Idle trials count, too: they go on changing, and kernels rely on a state that is whole.
    """

    def place(trials: TrialState) -> Array:
        return jnp.max(jax.vmap(partial(method.size_for, task))(trials.method))

    def turned(size: Any, trials: TrialState) -> TrialState:
        return replace(trials, method=jax.vmap(partial(method.in_size, size))(trials.method))

    def loop(here: int, size: Any, trials: TrialState) -> TrialState:
        def fit(trials: TrialState) -> Array:
            return go_on(trials) & (place(trials) == here)

        return turned(None, jax.lax.while_loop(fit, step, turned(size, trials)))

    loops = [partial(loop, here, size) for here, size in enumerate(method.sizes(task))]
    made: TrialState = jax.lax.while_loop(go_on, lambda trials: jax.lax.switch(place(trials), loops, trials), trials)
    return made
