"""`evoclaims look`: a robot's task drawn, or what a stored champion does in it."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final, get_args

import numpy as np

from evoclaims.cli.project import Project, open_project
from evoclaims.cli.stored_trial import Outings, Stored, describe, load, run_again
from evoclaims.cli.terminal import FIGURES, write
from evoclaims.core.drawing import Format
from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.envs.ecorobot.robot_task import RobotTask
from evoclaims.envs.ecorobot.views import pictures
from evoclaims.envs.ecorobot.views.motion import Motion, marks, motion
from evoclaims.paper.reproduction import Tier
from evoclaims.trials import devices

PICTURE: Final = get_args(Format)


@dataclass(frozen=True)
class Subject:
    """A trial to look at, read from the store when it is first needed.

    Attributes:
        options: which trial, which of its evaluation's episodes, and where to run them again.
        project: with the trial.
        task: of the trial.
    """

    options: argparse.Namespace
    project: Project
    task: RobotTask

    @cached_property
    def trial(self) -> Stored:
        """The trial."""
        options = self.options
        return load(self.project, options.tier, options.method, options.task, options.seed)

    @cached_property
    def outings(self) -> Outings:
        """The evaluation's episodes, run again."""
        chosen = devices.choose(self.options.device)
        return run_again(self.trial, self.task, chosen[0])

    @property
    def title(self) -> str:
        """Names the trial."""
        return f"{self.trial.title}, seed {self.options.seed}"

    @property
    def motion(self) -> Motion:
        """The motion of the chosen episode."""
        return motion(self.task.scene, self.outings.positions[self.options.episode])

    @property
    def difference(self) -> str:
        """Say how the episodes differ from the judged ones; empty when as many reach the goal."""
        options, recorded = self.options, self.trial.result.levels["success"][0]
        again = float(np.mean(self.outings.reached))
        if np.isclose(again, recorded):
            return ""
        return (
            f"The share of episodes that reach the goal is {again:g} here, and {recorded:g} in the record: these are "
            f"not quite the episodes that were judged. `evoclaims champion {options.method} --on {options.task} --tier "
            f"{options.tier} --seed {options.seed}` compares all values."
        )

    @property
    def episode_title(self) -> str:
        """Names the trial and the chosen episode."""
        episode = self.options.episode
        end = "reaches the goal" if self.outings.reached[episode] else "ends"
        return f"{self.title}, episode {episode}: {end} after {len(self.outings.positions[episode]):,} steps"


@dataclass(frozen=True)
class Form:
    """A way to look at a trial.

    Attributes:
        endings: of the files that it writes, the first when none is named.
        make: returns a file's contents, given the trial and the ending.
    """

    endings: tuple[str, ...]
    make: Callable[[Subject, str], bytes]


def main(options: argparse.Namespace) -> int:
    """Draw the task; with --method, show what the champion does."""
    project = open_project(options.storage)
    path, data = _task_alone(options, project) if options.method is None else _champion(options, project)
    write(path, data, ours=options.out is None)
    print(f"wrote {path}")
    return 0


def _task_alone(options: argparse.Namespace, project: Project) -> tuple[Path, bytes]:
    """Return the file to write without --method, and its contents."""
    tier = project.reproduction.tier(options.tier)
    if options.form is not None:
        raise UserError(f"--as {options.form} shows what a champion does; name its method with --method.")
    # Tasks of one name share a scene, even if some methods see more of it.
    tasks = {name: condition.task for (_, name), condition in tier.conditions.items()}
    if options.task not in tasks:
        raise UnknownNameError("task", options.task, tasks)
    task = _with_robot(tier, options.task, tasks[options.task])
    path, ending = _target(options.out, options.task, PICTURE)
    return path, pictures.draw(task, [], f"{options.task} ({options.tier})", ending)


def _champion(options: argparse.Namespace, project: Project) -> tuple[Path, bytes]:
    """Return the file to write with --method, and its contents."""
    tier = project.reproduction.tier(options.tier)
    name = "path" if options.form is None else options.form
    if name not in FORMS:
        raise UnknownNameError("way to look at a champion", name, FORMS)
    form = FORMS[name]
    task = _with_robot(tier, options.task, tier.condition(options.method, options.task).task)
    if not 0 <= options.episode < task.examined_episodes:
        raise UserError(
            f"The evaluation has {task.examined_episodes} episodes, 0 to {task.examined_episodes - 1}; "
            f"--episode is {options.episode}."
        )
    path, ending = _target(options.out, f"{options.method}-{options.task}-{options.seed}-{name}", form.endings)
    subject = Subject(options, project, task)
    data = form.make(subject, ending)
    print(f"{subject.trial.title}\n  {describe(subject.trial.result)}")
    if subject.difference:
        print(subject.difference)
    return path, data


def _with_robot(tier: Tier, name: str, task: Any) -> RobotTask:
    if not isinstance(task, RobotTask):
        known = sorted({on for (_, on), condition in tier.conditions.items() if isinstance(condition.task, RobotTask)})
        others = f"Tasks with one: {', '.join(known)}." if known else "No task of this tier has one."
        raise UserError(f"{name} has no robot and no ground, so there is nothing to look at. {others}")
    return task


def _target(out: str | None, default: str, endings: tuple[str, ...]) -> tuple[Path, str]:
    path = FIGURES / f"{default}.{endings[0]}" if out is None else Path(out)
    ending = path.suffix.removeprefix(".").lower()
    if ending not in endings:
        raise UserError(
            f"--out names a file that ends in .{' or .'.join(endings)}, which selects its format; "
            f"{str(path)!r} does not."
        )
    return path, ending


def _path(subject: Subject, ending: str) -> bytes:
    outings = subject.outings
    count = f"{sum(outings.reached)} of {len(outings.reached)} episodes reach the goal"
    title = f"{subject.title}\n{count}" if marks(subject.task) else subject.title
    return pictures.draw(subject.task, outings.torsos, title, ending)


FORMS: Final[Mapping[str, Form]] = {
    "path": Form(PICTURE, _path),
    "gif": Form(("gif",), lambda one, _: pictures.film(one.task, one.motion, one.episode_title)),
}
