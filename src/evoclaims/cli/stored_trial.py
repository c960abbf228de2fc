"""A stored trial as commands use it: its record and its champion."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evoclaims.cli.project import Project
from evoclaims.core.errors import UserError
from evoclaims.core.printable import printable
from evoclaims.paper.cost import Estimator, Wanted
from evoclaims.report.live_line import duration
from evoclaims.trials import champions, devices
from evoclaims.trials.crashes import why
from evoclaims.trials.imported import where_from
from evoclaims.trials.result import COMPLETE, TrialResult
from evoclaims.trials.spec import Condition, TrialSpec
from evoclaims.trials.time_limit import time_allowed


@dataclass(frozen=True)
class Stored:
    """A trial out of the store: its record, its champion's parameters (see `champions.load`), and where these are."""

    title: str
    condition: Condition
    result: TrialResult
    parameters: Any
    file: Path


def load(project: Project, tier: str, method: str, task: str, seed: int) -> Stored:
    """Return a stored trial with its champion: this environment's, or else the newest of other versions.

    Raises:
        UserError: for unknown names, a trial that is not stored (with the command that runs it and what that takes),
            and as `champions.load` does.
    """
    reproduction, store = project.reproduction, project.store
    condition, title = reproduction.tier(tier).condition(method, task), f"{method} on {task} ({tier})"
    if condition.existing is not None:
        raise UserError(f"{title} has no champion: its {where_from(condition)}.")
    spec = TrialSpec(condition, seed)
    result = store.get(spec.id, condition.versions)
    if result is None:
        estimator = Estimator(store, reproduction, tier, devices.choose("auto")[0].platform)
        cost = estimator.owed({"": Wanted((method, task), condition, [seed])})[""].cost
        takes = "" if cost.basis == "budget" else f", in about {duration(cost.seconds())}"
        raise UserError(
            f"{store.root} holds no trial of {title} with seed {seed}, and reference trials come without champions. "
            f"`evoclaims run {method} --on {task} --tier {tier} --trials 1 --first-seed {seed}` runs it{takes}."
        )
    return Stored(title, condition, result, champions.load(store, condition, result), store.champion_file(result))


def describe(result: TrialResult) -> str:
    """Return a trial in one line."""
    steps = result.metrics.get("environment_steps")
    after = "" if steps is None else f" after {int(steps):,} environment steps"
    spent = f"seed {result.seed}: {result.status}{after}"
    took = f"({duration(result.timing['run'])} for the batch of {result.timing['batch']})"
    if result.status == "timeout":
        limit = duration(time_allowed(result))
        return f"{spent}: its batch had {limit}; more by --time-limit, as much again by --retry {took}"
    if result.status not in COMPLETE:
        reason = why(result)
        return f"{spent}{': ' * bool(reason)}{printable(reason)} {took}"
    success = " ".join(f"{value:.3f}" for value in result.levels["success"])
    return f"{spent}, success by level {success} {took}"
