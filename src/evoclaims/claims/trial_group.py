"""The trials of one condition as a claim speaks of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from evoclaims.judging.measure import Event, Measure, Profile
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Condition

Fetch = Callable[[Condition, Sequence[int]], Sequence[TrialResult]]


@dataclass(frozen=True, eq=False)
class TrialGroup:
    """Trials that are run only when a verdict needs them, and what can be read from each.

    Attributes:
        method, task: the names by which a claim asked for them.
        condition: what is run.
        get: how trials are had: run, or read from the store.
    """

    method: str
    task: str
    condition: Condition
    get: Fetch = field(repr=False)

    @property
    def label(self) -> str:
        """A short name, such as "cma_es on n_parity"."""
        return f"{self.method} on {self.task}"

    @property
    def fingerprint(self) -> str:
        """The condition's id."""
        return self.condition.id

    def fetch(self, seeds: Sequence[int]) -> Sequence[TrialResult]:
        """Return one trial per seed."""
        return self.get(self.condition, seeds)

    @property
    def success(self) -> Profile:
        """Success of the final policy on each level's own table."""
        return Profile(self, "success", lambda t: t.levels["success"], self.condition.task.levels)

    @property
    def mean_success(self) -> Measure:
        """Success of the final policy, averaged over the levels."""
        return self._metric("mean_success", "mean success over levels")

    @property
    def last_success(self) -> Measure:
        """Success of the final policy on the last level."""
        return self._metric("last_success", "success on the last level")

    @property
    def furthest_solved(self) -> Measure:
        """Highest level solved while training; -1 for none."""
        return self._metric("furthest_solved", "furthest level solved")

    @property
    def furthest_reached(self) -> Measure:
        """Highest level trained on."""
        return self._metric("furthest_reached", "furthest level reached")

    @property
    def champion_is_mostly_hidden(self) -> Event:
        """More than half of the final champion's neurons are hidden; of methods that grow networks."""
        task = self.condition.task
        return Event(
            self,
            "most neurons of the champion are hidden",
            lambda t: t.curves["champion_nodes"][-1] > 2 * (task.observation_size + task.action_size),
        )

    @property
    def champion_is_mostly_input_and_output(self) -> Event:
        """No more than half of the final champion's neurons are hidden; of methods that grow networks."""
        task = self.condition.task
        return Event(
            self,
            "at most half of the champion's neurons are hidden",
            lambda t: t.curves["champion_nodes"][-1] <= 2 * (task.observation_size + task.action_size),
        )

    @property
    def solves_every_level(self) -> Event:
        """The final policy is right on every row of every level."""
        return self.success_everywhere_is(1.0)

    @property
    def solves_the_last_level(self) -> Event:
        """The last level was solved while training."""
        last = self.condition.task.levels - 1
        return Event(self, "solves the last level", lambda t: t.metrics["furthest_solved"] == last)

    @property
    def does_not_solve_the_last_level(self) -> Event:
        """The last level was never solved."""
        last = self.condition.task.levels - 1
        return Event(self, "does not solve the last level", lambda t: t.metrics["furthest_solved"] < last)

    def solves_level(self, level: int) -> Event:
        """This level, counted from 0, was solved while training."""
        return Event(self, f"solves level {level}", lambda t: t.metrics["furthest_solved"] >= level)

    def solves_no_level_beyond(self, level: int) -> Event:
        """No level above `level` (counted from 0) was solved while training."""
        return Event(self, f"solves no level beyond {level}", lambda t: t.metrics["furthest_solved"] <= level)

    def success_everywhere_is(self, value: float) -> Event:
        """The final policy's success is exactly `value` on every level."""
        name = "solves every level" if value == 1.0 else f"success is {value:g} on every level"
        return Event(self, name, lambda t: all(x == value for x in t.levels["success"]))

    @property
    def reward(self) -> Measure:
        """Reward of an episode of the final policy on the last level, averaged over the examination's episodes."""
        return self._metric("last_fitness", "episode reward")

    @property
    def stones(self) -> Measure:
        """Stones that the final policy crosses in their order, averaged over the examination's episodes."""
        return self._metric("stones", "stones crossed")

    @property
    def obstacles_passed(self) -> Measure:
        """Obstacles that the final policy leaves behind, averaged over the examination's episodes."""
        return self._metric("obstacles", "obstacles passed")

    @property
    def overturned(self) -> Measure:
        """Share of the final policy's steps that the robot spends upside-down."""
        return self._metric("upside_down", "share of steps upside-down")

    @property
    def control_cost(self) -> Measure:
        """What the final policy's actions cost in an episode."""
        return self._metric("control_cost", "control cost")

    @property
    def path_coverage(self) -> Measure:
        """Share of the reachable cells that the final policy's way leads through."""
        return Measure(self, "share of the maze covered", lambda t: t.metrics["coverage"])

    @property
    def archive_coverage(self) -> Measure:
        """Share of the reachable cells that hold an elite; of methods with an archive."""
        return Measure(self, "share of the maze covered", lambda t: t.curves["coverage"][-1])

    @property
    def reaches_the_target(self) -> Event:
        """The final policy reaches the target in more than half of the examination's episodes."""
        return Event(self, "reaches the target", lambda t: t.metrics["reached"] > 0.5)

    @property
    def never_reaches_the_target(self) -> Event:
        """The final policy reaches the target in no episode of the examination."""
        return Event(self, "never reaches the target", lambda t: t.metrics["reached"] == 0)

    @property
    def has_found_the_target(self) -> Event:
        """Some individual has reached the target; of methods with an archive."""
        return Event(self, "has found the target", lambda t: t.curves["reached"][-1] == 1)

    def ends_within(self, distance: float) -> Event:
        """The final policy ends within `distance` (m) of where the target counts as reached, on average."""
        return Event(self, f"ends within {distance:g} m of the target", lambda t: t.metrics["distance"] <= distance)

    def crosses_at_most(self, stones: float) -> Event:
        """The final policy crosses no more stones than this, averaged over the examination's episodes."""
        return Event(self, f"crosses at most {stones:g} stones", lambda t: t.metrics["stones"] <= stones)

    def crosses(self, stones: float) -> Event:
        """The final policy crosses exactly as many stones as this in every episode."""
        return Event(self, f"crosses {stones:g} stones", lambda t: t.metrics["stones"] == stones)

    def passes_at_most(self, obstacles: float) -> Event:
        """The final policy leaves no more obstacles behind than this, averaged over the examination's episodes."""
        return Event(self, f"passes at most {obstacles:g} obstacles", lambda t: t.metrics["obstacles"] <= obstacles)

    def _metric(self, key: str, name: str) -> Measure:
        """Return the measure that reads one of the record's metrics."""
        return Measure(self, name, lambda t: t.metrics[key])
