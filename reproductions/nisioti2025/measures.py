"""The paper's measures besides success and reward: stones, obstacles, paths through mazes, and network sizes.

The names in quotation marks are hashed into the claims' fingerprints.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np

from evoclaims import Event, Measure, Profile, TrialGroup
from evoclaims.envs import Circuit


def constant_success(circuit: Circuit) -> tuple[float, ...]:
    """Return the success by level of the best circuit that always gives the same answer."""
    table = circuit.table
    answers = itertools.product((False, True), repeat=table.targets.shape[1])
    rights = [((table.targets == np.array(answer)) | ~table.active).all(axis=1) for answer in answers]
    best = max(rights, key=lambda right: float(right.mean()))
    return tuple(float(best[:rows].mean()) for rows in table.rows_at_level)


class PaperTrials(TrialGroup):
    """Trials of one condition, with the measures of the paper's own tasks and methods."""

    @property
    def success_beyond_guessing(self) -> Measure:
        """Success at the last level of a circuit: 0 is that of the best constant answer, 1 is perfect."""
        guess = constant_success(self.condition.task)[-1]
        return self.measure(
            "success beyond guessing on the last level", lambda t: (t.metrics["last_success"] - guess) / (1.0 - guess)
        )

    @property
    def success_so_far(self) -> Profile:
        """Success of the final policy on each level, averaged with all levels before it."""
        return Profile(
            self,
            "success averaged over the levels so far",
            lambda t: tuple(np.cumsum(t.levels["success"]) / np.arange(1, len(t.levels["success"]) + 1)),
            self.condition.task.levels,
        )

    @property
    def stones(self) -> Measure:
        """Stones that the final policy crosses in order, averaged over the examination's episodes."""
        return self.measure("stones crossed", lambda t: t.metrics["stones"])

    @property
    def reward(self) -> Measure:
        """Episode reward of the final policy on the last level, in the task's own unit."""
        return replace(super().reward, unit=self._paid)

    @property
    def _paid(self) -> str:
        """What a reward counts: variants of two tasks pay once an episode, or metres."""
        if getattr(self.condition.task, "pays", "each") == "once":
            return "paid once an episode"
        return "paid in metres" if self.whole_way != 1 else "paid each step"

    @property
    def reward_of_a_stone(self) -> float:
        """Reward of a stone in an episode: its steps where each of them pays, 1 where one does."""
        task: Any = self.condition.task
        return 1.0 if getattr(task, "pays", "each") == "once" else float(task.episode_steps)

    @property
    def whole_way(self) -> float:
        """Reward of a whole way to a maze's target: 1, or where it is paid in metres their number."""
        return float(getattr(self.condition.task, "whole_way", 1))

    def crosses(self, stones: float) -> Event:
        """The final policy crosses exactly `stones` stones in every episode."""
        return self.event(f"crosses {stones:g} stones", lambda t: t.metrics["stones"] == stones, stones=stones)

    def crosses_at_most(self, stones: float) -> Event:
        """The final policy crosses at most `stones` stones, averaged over the examination's episodes."""
        return self.event(f"crosses at most {stones:g} stones", lambda t: t.metrics["stones"] <= stones, stones=stones)

    @property
    def path_coverage(self) -> Measure:
        """Share of the reachable cells on the final policy's path."""
        return self.measure("share of the maze on the path", lambda t: t.metrics["coverage"])

    @property
    def archive_coverage(self) -> Measure:
        """Share of the reachable cells with an elite; for methods with an archive."""
        return self.measure("share of the maze with an elite", lambda t: t.curves["coverage"][-1])

    @property
    def reaches_the_target(self) -> Event:
        """The final policy reaches the target in more than half of the examination's episodes."""
        return self.event("reaches the target", lambda t: t.metrics["reached"] > 0.5)

    @property
    def seldom_reaches_the_target(self) -> Event:
        """The final policy reaches the target in at most half of the examination's episodes."""
        return self.event("seldom reaches the target", lambda t: t.metrics["reached"] <= 0.5)

    @property
    def share_of_targets(self) -> Measure:
        """Share of the examination's episodes in which the final policy reaches the target."""
        return self.measure("share of episodes that reach the target", lambda t: t.metrics["reached"])

    @property
    def target_found(self) -> Measure:
        """1 if some individual has reached the target, among stones after all others, else 0; with an archive."""
        return self.measure("whether the target was found", lambda t: t.curves["reached"][-1])

    @property
    def never_reaches_the_target(self) -> Event:
        """The final policy reaches the target in no episode of the examination."""
        return self.event("never reaches the target", lambda t: t.metrics["reached"] == 0)

    @property
    def has_found_the_target(self) -> Event:
        """Some individual has reached the target, among stones after all others; for methods with an archive."""
        return self.event("has found the target", lambda t: t.curves["reached"][-1] == 1)

    def ends_within(self, distance: float) -> Event:
        """The final policy ends within `distance` (m) of where the target counts as reached, on average."""
        return self.event(
            f"ends within {distance:g} m of the target", lambda t: t.metrics["distance"] <= distance, distance=distance
        )

    def passes_at_most(self, obstacles: float) -> Event:
        """The final policy passes at most `obstacles` obstacles, averaged over the examination's episodes."""
        return self.event(
            f"passes at most {obstacles:g} obstacles",
            lambda t: t.metrics["obstacles"] <= obstacles,
            obstacles=obstacles,
        )

    @property
    def obstacles_passed(self) -> Measure:
        """Obstacles that the final policy passes, averaged over the examination's episodes."""
        return self.measure("obstacles passed", lambda t: t.metrics["obstacles"])

    @property
    def speed(self) -> Measure:
        """Metres that the final policy advances in a step, averaged over the examination's episodes."""
        return self.measure("m a step", lambda t: t.metrics["furthest"] / t.metrics["episode_steps"])

    @property
    def reward_before_costs(self) -> Measure:
        """Episode reward of the final policy, without subtracting the control cost."""
        return self.measure(
            "reward before costs", lambda t: t.metrics["last_fitness"] + t.metrics["control_cost"], unit=self._paid
        )

    @property
    def reward_in_training(self) -> Measure:
        """Reward of the last generation's best individual, or the archive's best elite, in its only episode."""
        return self.measure("reward of training's best episode", lambda t: t.curves["fitness"][-1], unit=self._paid)

    @property
    def reward_gained(self) -> Measure:
        """Reward per episode at the last report of training, minus that at the first; for tasks with one level."""
        return self.measure(
            "reward gained", lambda t: t.curves["fitness"][-1] - t.curves["fitness"][0], unit=self._paid
        )

    @property
    def overturned(self) -> Measure:
        """Share of the final policy's steps in which the robot is upside-down."""
        return self.measure("share of steps upside-down", lambda t: t.metrics["upside_down"], better="lower")

    def is_overturned(self, share: float) -> Event:
        """The robot is upside-down in more than `share` of the final policy's steps."""
        return self.event(
            f"upside-down in more than {share:g} of the steps", lambda t: t.metrics["upside_down"] > share, share=share
        )

    def pays(self, share: float) -> Event:
        """The final policy's control cost is more than `share` of its reward before costs."""
        return self.event(
            f"control cost above {share:g} of the reward",
            lambda t: t.metrics["control_cost"] > share * (t.metrics["last_fitness"] + t.metrics["control_cost"]),
            share=share,
        )

    @property
    def control_cost(self) -> Measure:
        """Cost of the final policy's actions per episode."""
        return self.measure("control cost", lambda t: t.metrics["control_cost"], better="lower")

    @property
    def champion_is_mostly_hidden(self) -> Event:
        """More than half of the final champion's neurons are hidden; for methods that grow networks."""
        most = self._neurons_half_hidden
        return self.event("most neurons of the champion are hidden", lambda t: t.curves["champion_nodes"][-1] > most)

    @property
    def champion_is_mostly_input_and_output(self) -> Event:
        """At most half of the final champion's neurons are hidden; for methods that grow networks."""
        most = self._neurons_half_hidden
        name = "at most half of the champion's neurons are hidden"
        return self.event(name, lambda t: t.curves["champion_nodes"][-1] <= most)

    @property
    def champion_size(self) -> Measure:
        """Neurons and connections of the final champion; for methods that grow networks.

        All neurons, since genomes with few inputs have room for more hidden ones.
        """
        return self.measure(
            "neurons and connections of the champion",
            lambda t: t.curves["champion_nodes"][-1] + t.curves["champion_connections"][-1],
        )

    @property
    def champion_connections(self) -> Measure:
        """Connections of the final champion; for methods that grow networks."""
        return self.measure("connections of the champion", lambda t: t.curves["champion_connections"][-1])

    @property
    def _neurons_half_hidden(self) -> int:
        """Total neurons of a network in which half are hidden."""
        return 2 * (self.condition.task.observation_size + self.condition.task.action_size)

    # Of mechanisms (reproductions/nisioti2025/mechanisms.py).

    def on_average(self, curve: str) -> Measure:
        """Mean of a training curve over all reports."""
        return self.measure(f"{curve} on average", lambda t: math.fsum(t.curves[curve]) / len(t.curves[curve]))

    def share(self, part: str, other: str) -> Measure:
        """Sum of the curve `part` over all reports, as a share of the sum of `part` and `other`."""

        def read(t: Any) -> float:
            mine, others = math.fsum(t.curves[part]), math.fsum(t.curves[other])
            return mine / (mine + others) if mine else 0.0

        return self.measure(f"share of {part} against {other}", read)

    def at_the_end(self, curve: str) -> Measure:
        """Value of a training curve at the last report."""
        return self.measure(f"{curve} at the end", lambda t: t.curves[curve][-1])

    def fall(self, curve: str) -> Measure:
        """How much a training curve falls per generation, from the first report to the last."""
        return self.measure(
            f"fall of {curve} in a generation",
            lambda t: (t.curves[curve][0] - t.curves[curve][-1]) / (t.curves["steps"][-1] - t.curves["steps"][0]),
        )

    def always(self, curve: str, value: float) -> Event:
        """A training curve is exactly `value` at every report."""
        return self.event(f"{curve} is always {value:g}", lambda t: all(one == value for one in t.curves[curve]))
