"""`evoclaims watch`: new trials each night, and an alarm when all nights together show that something has changed."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Final

from msgspec import structs

from evoclaims.claims.power import Pilots, with_test
from evoclaims.cli.project import Project, open_project
from evoclaims.cli.running import Execution
from evoclaims.cli.terminal import REPORT, styled, write
from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.execution.job import Job
from evoclaims.execution.worker import WorkOrder
from evoclaims.judging.exact import MAX_TRIALS
from evoclaims.paper import references
from evoclaims.report.console import PlainSpokenConsole, plain_table
from evoclaims.report.formatting import literal, plural
from evoclaims.report.table_cells import NONE
from evoclaims.trials.result import COMPLETE, TrialResult
from evoclaims.trials.spec import TrialSpec
from evoclaims.verdicts import watch_file
from evoclaims.verdicts.watch import ALPHA, Family, Watch, Watched, kinds_of, watched
from evoclaims.verdicts.watch_file import Night

FIRST_SEED: Final = 10_000
"""Of the first night, unless a committed trial or the tier's design has it or a later one."""

FOUND: Final = (0.5, 0.8)
"""Shifts, in standard deviations, of which the table shows after how many nights they are found."""

MOST_NIGHTS: Final = 10


def main(options: argparse.Namespace) -> int:
    """Run a night and add it to the file; 1 on an alarm, and while one of an earlier series stays."""
    if options.form not in (None, "markdown"):
        raise UnknownNameError("form", options.form, ("markdown",))
    project = open_project(options.storage)
    tier = project.reproduction.tier(options.tier)
    n = options.trials
    if not 1 <= n <= MAX_TRIALS:
        raise UserError(f"--trials takes 1 to {MAX_TRIALS} trials per condition, not {n}.")
    path = project.reproduction.folder / watch_file.FILE
    before, nights = watch_file.load(path)
    watch, left_out = watch_of(project, options.tier)
    going_on = () if options.restart else watch.series(nights)
    design = tier.design.with_third_look()
    first = watch.first_fresh_seed(max(FIRST_SEED, design.first_seed + design.last.n), nights)
    first = _after_older_code(project, watch, first, n)
    order = WorkOrder(options.storage, options.tier, options.device, first, n)
    trials = _run(project, watch, order, options)
    number = going_on[-1].series if going_on else max((night.series for night in nights), default=0) + 1
    series = (*going_on, _night(watch, trials, going_on, number))
    alarms = watch.alarms(series)
    found = tuple(line for those in alarms.values() for line in those)
    series = (*going_on, structs.replace(series[-1], alarms=found, restart=options.restart))
    watch_file.append(path, before, series[-1])
    mine = [*(night for night in nights if night.tier == watch.tier), series[-1]]
    stay = watch_file.standing(mine)
    shown = [*found, *(line for one, more in stay.items() for line in (one, *more))]
    had = {label for night in watch_file.since_restart(mine) for label in night.values}
    gone = sorted(had - {*left_out, *(one.label for one in watch.conditions)})
    sentences = _sentences(watch, series, left_out, gone, shown, path)
    console = PlainSpokenConsole(file=styled())
    headings = ("family", "evidence", *(f"finds {shift:g} SD in" for shift in FOUND))
    console.print_whole(plain_table(headings, _rows(watch, series[-1])))
    print(*sentences, sep="\n")
    if options.form is not None:
        out = Path(options.out or REPORT / "watch.md")
        title = f"Trials have changed: {', '.join(alarms) or 'an earlier alarm stays'}" if shown else "No alarm"
        write(out, _markdown(title, sentences).encode(), ours=options.out is None)
        print(f"wrote {out}")
    return int(bool(shown))


def watch_of(project: Project, tier: str) -> tuple[Watch, list[str]]:
    """Return what is watched, and the conditions of claims that have too few committed trials.

    Raises:
        UserError: when a claim is broken, since nothing is known of its conditions; or when nothing can be watched.
    """
    reproduction, (collected,) = project.reproduction, project.collect([("", tier)])
    every = with_test(collected)
    broke = [f"{one.test.name} ({one.report.reason.removesuffix('.')})" for one in every if one.assertion is None]
    if broke:
        raise UserError(
            f"Nothing is watched, since it is not known which conditions {plural(len(broke), 'broken claim')} of the "
            f"{tier} tier would read: {', '.join(broke)}. Mend each, or mark it with pytest.mark.skip."
        )
    first, second = (Pilots(reproduction, tier, every, second=second) for second in (False, True))
    found: list[Watched] = []
    left_out: list[str] = []
    for names, group in sorted(first.groups.items()):
        if group.condition.existing:  # an imported table has no new seeds
            continue
        mine = references.of_condition(reproduction.references, tier, *names, group.condition.id)
        pilot = [trial for those in (first, second) if not those.unfit(names) for trial in those.trials[names]]
        one = watched(names, group.condition, mine, pilot, partial(first.reads, names))
        if one is None:
            left_out.append(" on ".join(names))
        else:
            found.append(one)
    if not found:
        raise UserError(
            f"Nothing can be watched: no condition of the {tier} tier's claims has ten committed trials. Run the "
            "claims, then `evoclaims reference`."
        )
    return Watch(tier, tuple(found)), left_out


def _after_older_code(project: Project, watch: Watch, first: int, n: int) -> int:
    """Return the first seed, from `first` up, from which a night has no trial of code that was edited since.

    There are such trials after a night that was killed before its entry was written.
    """
    older: dict[int, tuple[str, ...]] = {}
    for condition in (one.condition for one in watch.conditions):
        versions = condition.versions
        for seed in range(first, first + n):
            stored = project.store.made_with(TrialSpec(condition, seed).id, versions)
            if stored is not None and (edited := condition.edited_since([stored])):
                older[seed] = (*older.get(seed, ()), *edited)
    if not older:
        return first
    after, names = max(older) + 1, sorted({name for edited in older.values() for name in edited})
    listed = ", ".join(names)
    print(f"Trials up to seed {after - 1} ran before {listed} was edited or renamed: they do not count for this night.")
    return _after_older_code(project, watch, after, n)


def _run(project: Project, watch: Watch, order: WorkOrder, options: argparse.Namespace) -> dict[str, list[TrialResult]]:
    """Run a night's trials, and return them by label of the condition.

    Raises:
        UserError: when some have no result; the next call goes on with the same seeds.
    """
    running = Execution(project, order, options.host)
    running.check()
    wanted = {Job("", *one.names): one.condition for one in watch.conditions}
    failed = sum(bool(ended.error) for ended in running.run(wanted, lambda text: print(f"  {text}", flush=True)))
    again = "so this night is not added. The same command goes on with it."
    if failed:
        raise UserError(f"{failed} of {len(wanted)} conditions failed (above), {again}")
    found: dict[str, list[TrialResult]] = {}
    for one in watch.conditions:
        stored = [project.store.get(TrialSpec(one.condition, seed).id, one.condition.versions) for seed in order.seeds]
        found[one.label] = [trial for trial in stored if trial is not None and trial.status in COMPLETE]
        if len(found[one.label]) < len(order.seeds):
            bad = {trial.status for trial in stored if trial is not None} - {*COMPLETE}
            raise UserError(f"{one.label}: trials {' and '.join(sorted(bad)) or 'are missing'}, {again}")
    return found


def _night(watch: Watch, trials: Mapping[str, Sequence[TrialResult]], going_on: Sequence[Night], number: int) -> Night:
    """Return the entry of a night, after those that it goes on with."""
    some = [trial for those in trials.values() for trial in those]
    versions = {name: version for one in watch.conditions for name, version in one.condition.versions.items()}
    night = Night(
        date=datetime.now(UTC).date().isoformat(),
        tier=watch.tier,
        series=number,
        rules=watch.rules,
        seeds=tuple(sorted({trial.seed for trial in some})),
        device=", ".join(kinds_of(some)),
        level=watch.level,
        versions={name: version for name, version in sorted(versions.items()) if version},
        values={one.label: one.read(trials[one.label]) for one in watch.conditions},
        evidence={},
    )
    evidence = {family.label: family.path((*going_on, night))[-1] for family in watch.families}
    return structs.replace(night, evidence=evidence)


def _rows(watch: Watch, night: Night) -> list[tuple[str, ...]]:
    """Return a row for each family that can show something, the largest evidence first."""
    shown = [one for one in watch.families if one.of_method or one.moves]
    shown.sort(key=lambda one: -night.evidence[one.label])
    return [
        (one.label, f"{night.evidence[one.label]:.2g}", *(_found_in(watch, one, shift, night) for shift in FOUND))
        for one in shown
    ]


def _found_in(watch: Watch, family: Family, shift: float, night: Night) -> str:
    """Return in how many nights a shift of all measures of a family is found, half of the time."""
    count = family.nights_to_find(shift, len(night.seeds), watch.level)
    if count is None:
        return NONE
    return plural(count, "night") if count <= MOST_NIGHTS else f"> {MOST_NIGHTS} nights"


def _sentences(
    watch: Watch,
    series: Sequence[Night],
    left_out: Sequence[str],
    gone: Sequence[str],
    alarms: Sequence[str],
    path: Path,
) -> list[str]:
    """Return what a night has shown, and what to do next."""
    last, families = series[-1], plural(len(watch.families), "family", "families")
    lines = [
        f"Night {len(series)} of series {last.series} ({last.tier}): seeds {last.seeds[0]} to {last.seeds[-1]} of "
        f"{plural(len(watch.conditions), 'condition')}.",
        f"Alarm at an evidence of {watch.level:g} ({families} / α {ALPHA:g}). If nothing has changed, a "
        f"series of any length has an alarm with a probability of at most {ALPHA:g}.",
    ]
    if len(series) == 1 and last.series > 1:
        lines.append(
            "A new series: earlier nights do not count, on request, or since conditions, committed trials or what "
            "claims read have changed."
        )
    if left_out:
        lines.append(f"Not watched, for want of ten committed trials: {', '.join(left_out)}.")
    lacking = [
        f"{one.label}: {measure} (seed{'s' * (len(seeds) > 1)} {', '.join(map(str, seeds))})"
        for one in watch.conditions
        for measure, seeds in one.lacking.items()
    ]
    if lacking:
        lines.append(f"Not watched, since some reference trials lack it: {', '.join(lacking)}.")
    if edited := sorted({name for one in watch.conditions for name in one.edited}):
        lines.append(
            f"Edited or renamed since the committed trials: {', '.join(edited)}. A change may come of that, not of "
            "versions, until `evoclaims reference` writes new ones."
        )
    if gone:
        lines.append(
            f"No longer watched, since no claim reads it: {', '.join(gone)}. If this is meant, begin a new series with "
            "--restart."
        )
    lines += alarms
    if alarms:
        lines.append(
            f"Next: look into it (`evoclaims across`, `evoclaims bisect`), commit {path.name}, and begin a new series "
            "with --restart."
        )
    else:
        lines.append(f"No alarm. Next: commit {path.name}; the next night goes on with seed {last.seeds[-1] + 1}.")
    return lines


def _markdown(title: str, sentences: Sequence[str]) -> str:
    return "\n\n".join([f"# {literal(title)}", "\n".join(f"* {literal(line)}" for line in sentences)]) + "\n"
