"""`evoclaims plan`: what a tier would run, what it costs here, and what its verdicts can show."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from typing import Final

from rich.table import Table

from evoclaims.cli.project import open_project
from evoclaims.cli.terminal import styled
from evoclaims.core.errors import UserError
from evoclaims.judging.verdict import Outcome
from evoclaims.methods.training_loop import TrainingLoop
from evoclaims.paper.cost import Pace, known_pace, measured_pace
from evoclaims.paper.reproduction import Tier
from evoclaims.paper.spent import Spent, spent
from evoclaims.report.console import PlainSpokenConsole, plain_table
from evoclaims.report.live_line import duration
from evoclaims.trials import devices
from evoclaims.trials.batches import StoredTrials
from evoclaims.trials.imported import where_from
from evoclaims.trials.spec import Condition
from evoclaims.trials.store import Store
from evoclaims.verdicts.claim_report import ClaimReport

Costs = Mapping[tuple[str, str], Spent]
"""What the reference trials have cost, by method and task."""

HOUR: Final = 3600
"""Seconds."""


def main(options: argparse.Namespace) -> int:
    """Print conditions with their cost, then claims with their attainable p."""
    project = open_project(options.storage)
    reproduction, store = project.reproduction, project.store
    tier = reproduction.tier(options.tier)
    chosen = devices.choose(options.device)
    kind = options.like or chosen[0].device_kind
    reports = project.judge(options.tier)
    read = sorted({(source.method, source.task) for report in reports for source in report.sources})
    used = [names for names in read if tier.condition(*names).existing is None]

    def pace(condition: Condition, method: str, task: str) -> Pace | None:
        known = known_pace(condition, store, reproduction.references, options.tier, method, task, kind)
        compiled = not isinstance(condition.method, TrainingLoop)  # a loop has no steps that could be timed
        return measured_pace(condition, chosen) if known is None and options.measure and compiled else known

    paces = {names: pace(tier.condition(*names), *names) for names in used}
    costs = {names: spent(reproduction, options.tier, *names) for names in read}
    if options.like and not any(paces.values()):
        raise UserError(f"No trial of the {options.tier} tier at hand was made on a device called {options.like!r}.")
    console = PlainSpokenConsole(file=styled())
    where = f"as they took on one {kind}" if options.like else f"on {len(chosen)} × {kind}"
    console.print(f"Conditions of the {options.tier} tier, {where}")
    console.print_whole(_conditions(tier, store, used, paces, costs, project.config.seconds(None)))
    own, timed = sum(_has_run(store, tier, names) for names in used), sum(pace is not None for pace in paces.values())
    if not options.like and own < timed:
        console.print(
            f"Times are by this store's own trials for {own} of {len(used)} conditions, for {timed - own} by "
            f"{'a few steps timed now, or by ' if options.measure else ''}reference trials on such a device, perhaps "
            "of another machine. A trial that has solved every level stops earlier."
        )
    for names in read:
        if names not in used:
            condition, n = tier.condition(*names), tier.design.last.n
            few = f", and the design looks at {n}" if len(condition.existing or ()) < n else ""
            said = f"{' on '.join(names)}: nothing to run: {where_from(condition)}{few}"
            console.print(said)
    for sentence in _about({names: costs[names] for names in used}, tier.design.last.n):
        console.print(sentence)
    ends = ", ".join(f"{outcome.symbol} {outcome}" for outcome in (Outcome.SUPPORTED, Outcome.REFUTED))
    console.print(
        f"\nClaims: the smallest p that the design allows (n trials a side, α {tier.design.alpha:g}), and how each "
        f"look can end them: {ends}, or neither (no)"
    )
    console.print_whole(_claims(reports, costs))
    for report in reports:
        if report.outcome is Outcome.ERROR and not report.attainable:
            console.print(f"{report.name}: error: {report.reason}")
    if any(pace is None for pace in paces.values()):
        console.print("\nTimes are unknown where no trial has run on such a device; --measure times a few steps.")
    return 0


def _conditions(
    tier: Tier,
    store: Store,
    used: Sequence[tuple[str, str]],
    paces: dict[tuple[str, str], Pace | None],
    costs: Costs,
    limit: float,
) -> Table:
    """Build the table of conditions; steps and times are upper bounds, since a trial that has solved all levels stops.

    Trials that ran out of less time than `limit` (seconds) count as missing, too. Where there are reference trials,
    their cost is shown.
    """
    kinds, cores = _kinds(costs), any(cost.core_pace for cost in costs.values())
    measured = [f"took on one\n{kind}" for kind in kinds] + ["CPU\ncore hours"] * cores
    headings = ("condition", "cached", "missing", "environment\nsteps", "time,\nat most", *measured)
    table = plain_table(headings, ())
    seeds = tier.design.seeds(tier.design.last.n)
    steps, seconds, unknown = 0, 0.0, False
    needed = {names: costs[names].core_seconds(tier.condition(*names).environment_steps * len(seeds)) for names in used}
    for names in used:
        condition = tier.condition(*names)
        missing = sum(map(StoredTrials(store, condition, time_limit=limit).lacks, seeds))
        owed = missing * condition.environment_steps
        pace = paces[names]
        time = 0.0 if not missing else None if pace is None else pace.seconds(condition, missing)
        table.add_row(
            " on ".join(names),
            str(len(seeds) - missing),
            str(missing),
            f"{owed:,}",
            "unknown" if time is None else duration(time),
            *(_took(costs, [names], kind) for kind in kinds),
            *([_core_hours(needed[names])] if cores else []),
        )
        steps, seconds, unknown = steps + owed, seconds + (time or 0.0), unknown or time is None
    table.add_row(
        "total",
        "",
        "",
        f"{steps:,}",
        "unknown" if unknown and not seconds else duration(seconds) + (" and more" if unknown else ""),
        *(_took(costs, used, kind) for kind in kinds),
        *([_core_hours(sum(filter(None, needed.values())))] if cores else []),
        style="bold",
    )
    return table


def _has_run(store: Store, tier: Tier, names: tuple[str, str]) -> bool:
    """Whether the store has a trial of a condition, made with the installed versions."""
    stored = StoredTrials(store, tier.condition(*names))
    return any(map(stored.get, tier.design.seeds(tier.design.last.n)))


def _kinds(costs: Costs) -> list[str]:
    """Return the kinds of accelerators that reference trials were made on."""
    return sorted({kind for cost in costs.values() for kind in cost.seconds})


def _took(costs: Costs, names: Sequence[tuple[str, str]], kind: str) -> str:
    """Return the time that the reference trials of some conditions took on a kind of accelerator."""
    found = [costs[name] for name in names]
    seconds = sum(cost.seconds.get(kind, 0.0) for cost in found)
    missing = any(not cost.trials for cost in found)
    if not seconds:
        return "not run" if missing else "–"
    return duration(seconds) + (" and more" if missing else "")


def _core_hours(seconds: float | None) -> str:
    """Return hours of one core of a CPU."""
    if seconds is None:
        return "unknown"
    hours = seconds / HOUR
    return f"{hours:,.0f}" if hours >= 1 else "< 1"


def _about(costs: Costs, n: int) -> list[str]:
    """Say how to read the cost of the reference trials, and which are missing."""
    if not any(cost.trials for cost in costs.values()):
        return []
    few = [f"{' on '.join(names)} ({cost.trials})" for names, cost in costs.items() if cost.trials < n]
    sentences = [
        "Measured on the committed reference trials: what they took, with compiling. Estimated from them: the hours of "
        "a CPU's core that all trials' whole budgets would take, at the pace of that method and task at any tier."
    ]
    return [*sentences, f"Fewer than {n} reference trials: {', '.join(few)}."] if few else sentences


def _claims(reports: Sequence[ClaimReport], costs: Costs) -> Table:
    """Build the table of claims."""
    kinds = _kinds(costs)
    took = [f"took on one\n{kind}" for kind in kinds]
    table = plain_table(("claim", "n", "α", "p for", "p\nagainst", "can\nend", *took), (), names=0)
    table.columns[0].justify = "left"
    for report in reports:
        used = [(source.method, source.task) for source in report.sources]
        for look in report.attainable:
            smallest = {Outcome.SUPPORTED: look.supported, Outcome.REFUTED: look.refuted}
            reach = [outcome.symbol for outcome, p in smallest.items() if p <= look.alpha]
            table.add_row(
                report.name,
                str(look.n),
                f"{look.alpha:g}",
                f"{look.supported:.2g}",
                f"{look.refuted:.2g}",
                " ".join(reach) or "no",
                *(_took(costs, used, kind) for kind in kinds if look is report.attainable[-1]),
            )
    return table
