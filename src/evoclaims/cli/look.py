"""`evoclaims look`: a robot's task drawn, or what a stored champion does in it."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, get_args

import numpy as np

from evoclaims.cli.project import Project, open_project
from evoclaims.cli.stored_trial import describe, load, run_again
from evoclaims.cli.terminal import FIGURES, write
from evoclaims.core.drawing import Format
from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.envs.ecorobot.robot_task import RobotTask
from evoclaims.envs.ecorobot.views import pictures
from evoclaims.envs.ecorobot.views.motion import marks, motion
from evoclaims.paper.reproduction import Tier
from evoclaims.trials import devices

PICTURE: Final = get_args(Format)

FORMS: Final[Mapping[str, tuple[str, ...]]] = {"path": PICTURE, "gif": ("gif",)}
"""Ways to look at a trial, each with the endings of its files; the first is taken when none is named."""


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
    for option, value in (("as", options.form), ("seed", options.seed), ("episode", options.episode)):
        if value is not None:
            raise UserError(f"--{option} {value} shows what a champion does; name its method with --method.")
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
    seed, episode = options.seed or 0, options.episode or 0
    if name not in FORMS:
        raise UnknownNameError("way to look at a champion", name, FORMS)
    task = _with_robot(tier, options.task, tier.condition(options.method, options.task).task)
    if not 0 <= episode < task.examined_episodes:
        raise UserError(
            f"The evaluation has {task.examined_episodes} episodes, 0 to {task.examined_episodes - 1}; "
            f"--episode is {episode}."
        )
    path, ending = _target(options.out, f"{options.method}-{options.task}-{seed}-{name}", FORMS[name])
    trial = load(project, options.tier, options.method, options.task, seed)
    outings = run_again(trial, task, devices.choose(options.device)[0])
    title = f"{trial.title}, seed {seed}"
    if name == "gif":
        positions, reached = outings.positions[episode], outings.reached[episode]
        end = f"{'reaches the goal' if reached else 'ends'} after {len(positions):,} steps"
        data = pictures.film(task, motion(task.scene, positions), f"{title}, episode {episode}: {end}")
    else:
        count = f"\n{sum(outings.reached)} of {len(outings.reached)} episodes reach the goal" * bool(marks(task))
        data = pictures.draw(task, outings.torsos, f"{title}{count}", ending)
    print(f"{trial.title}\n  {describe(trial.result)}")
    recorded, again = trial.result.levels["success"][0], float(np.mean(outings.reached))
    if not np.isclose(again, recorded):
        print(
            f"The share of episodes that reach the goal is {again:g} here, and {recorded:g} in the record: these are "
            f"not quite the episodes that were judged. `evoclaims champion {options.method} --on {options.task} --tier "
            f"{options.tier} --seed {seed}{project.store.option}` compares all values."
        )
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
