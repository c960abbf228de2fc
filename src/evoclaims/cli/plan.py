"""`evoclaims plan`: what a tier would run, what it costs here, and what its verdicts can show."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

from rich.table import Table

from evoclaims.claims.fetching import NotStoredError, StoredOnly
from evoclaims.cli.project import open_project
from evoclaims.cli.terminal import styled
from evoclaims.core.errors import UserError
from evoclaims.core.printable import printable
from evoclaims.core.raised import in_one_line
from evoclaims.judging.verdict import Outcome
from evoclaims.methods.training_loop import TrainingLoop
from evoclaims.paper.pace import Pace, known_pace, measured_pace
from evoclaims.paper.reproduction import Tier
from evoclaims.paper.spent import Spent, spent
from evoclaims.paper.variant import Names
from evoclaims.report.console import PlainSpokenConsole, plain_table
from evoclaims.report.live_line import duration
from evoclaims.trials import devices
from evoclaims.trials.batches import StoredTrials
from evoclaims.trials.imported import where_from
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Condition
from evoclaims.trials.store import DamagedFileError, Store
from evoclaims.verdicts.claim_report import ClaimReport

Counts = Mapping[Names, int]
"""Most trials of each condition that claims may need, by method and task."""

Costs = Mapping[Names, Spent]
"""What the reference trials have cost, by method and task."""

HOUR: Final = 3600
"""Seconds."""

AND_ELSEWHERE: Final = "\nand elsewhere"
"""Follows a sum without conditions whose trials ran on other devices."""

AND_MORE: Final = "\nand more"
"""Says of a sum that some of it is unknown; on a line of its own, so that the column stays narrow."""


def main(options: argparse.Namespace) -> int:
    """Print conditions with their cost, then claims with their attainable p; 1 when a step cannot be timed."""
    project = open_project(options.storage)
    reproduction, store, variant = project.reproduction, project.store, options.variant
    tier = reproduction.tier(options.tier, variant)
    chosen = devices.choose(options.device)
    kind = options.like or chosen[0].device_kind
    session = replace(project.session(variant), fetch=_SoundOnly(project.archive))
    (reports,) = project.judge_sessions([(session, options.tier)])
    if variant:
        touched = reproduction.changed_by(variant, options.tier)
        reports = [report for report in reports if not touched.keys().isdisjoint(_read([report]))]
        read = [names for names in _read(reports) if names in touched]
        if not read:
            raise UserError(f"The variant {variant} changes no condition that claims of the {options.tier} tier read.")
    else:
        read = _read(reports)
    used = [names for names in read if tier.condition(*names).existing is None]
    counts = _counts(tier, reports)

    untimed: list[str] = []

    def pace(condition: Condition, method: str, task: str) -> Pace | None:
        known = known_pace(condition, store, reproduction.references, options.tier, method, task, kind)
        if known is not None or not options.measure or isinstance(condition.method, TrainingLoop):  # that has no steps
            return known
        try:
            return measured_pace(condition, chosen)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # an error in a method or a task must not hide the others, as in `run_jobs`
            untimed.append(f"{method} on {task} cannot be timed: {in_one_line(error, project.config.root)}.")
            return None

    paces = {names: pace(tier.condition(*names), *names) for names in used}
    costs = {names: spent(reproduction, options.tier, *names, variant) for names in read}
    if options.like and not any(paces.values()):
        raise UserError(f"No trial of the {options.tier} tier at hand was made on a device called {options.like!r}.")
    console = PlainSpokenConsole(file=styled())
    where = f"as they took on one {kind}" if options.like else f"on {len(chosen)} × {kind}"
    under = f" that {variant} changes" if variant else ""
    console.print(f"Conditions of the {options.tier} tier{under}, {where}")
    console.print_whole(_conditions(tier, store, used, counts, paces, project.config.seconds(None)))
    if more := [" on ".join(names) for names in used if counts[names] > tier.design.last.n]:
        console.print(
            f"Trials beyond {tier.design.last.n} of a condition run only where a claim with a third look is open "
            f"after them: {', '.join(more)}."
        )
    own, timed = (
        sum(_has_run(store, tier, names, counts) for names in used),
        sum(pace is not None for pace in paces.values()),
    )
    if not options.like and own < timed:
        console.print(
            f"Times are by this store's own trials for {own} of {len(used)} conditions, for {timed - own} by "
            f"{'a few steps timed now, or by ' if options.measure else ''}reference trials on such a device, perhaps "
            "of another machine. A trial that has solved every level stops earlier."
        )
    for names in read:
        if names not in used:
            condition, n = tier.condition(*names), counts[names]
            few = f", and the design looks at {n}" if len(condition.existing or ()) < n else ""
            line = f"{' on '.join(names)}: nothing to run: {where_from(condition)}{few}"
            console.print(line)
    _print_spent(console, tier, {names: costs[names] for names in used}, counts)
    ends = ", ".join(f"{end.symbol} {end}" for end in (Outcome.SUPPORTED, Outcome.REFUTED, Outcome.SMALLER))
    console.print(
        f"\nClaims: the smallest p that the design allows (n trials a side, α {tier.design.alpha:g}), and how each "
        f"look can end them: {ends}, or neither (no)"
    )
    if variant:
        console.print(f"The time of a claim is that of the conditions that {variant} changes.")
    console.print_whole(_claims(reports, costs))
    for report in reports:
        if report.outcome is Outcome.ERROR and not report.attainable:
            console.print(f"{report.name}: error: {report.reason}")
    if any(pace is None for pace in paces.values()) and not untimed:
        console.print("\nTimes are unknown where no trial has run on such a device; --measure times a few steps.")
    for line in untimed:
        print(f"evoclaims: {printable(line)}", file=sys.stderr)
    return int(bool(untimed))


class _SoundOnly(StoredOnly):
    """Trials at hand; damaged ones are missing, so that the conditions of their claims are planned, too."""

    def __call__(self, condition: Condition, seeds: Sequence[int]) -> Sequence[TrialResult]:
        """Return one trial per seed, or raise `NotStoredError`."""
        try:
            return super().__call__(condition, seeds)
        except DamagedFileError as error:
            raise NotStoredError(str(error), condition.id) from error


def _read(reports: Sequence[ClaimReport]) -> list[Names]:
    """Return the conditions that claims read."""
    return sorted({(source.method, source.task) for report in reports for source in report.sources})


def _counts(tier: Tier, reports: Sequence[ClaimReport]) -> Counts:
    """Return how many trials of each condition claims may need: the tier's, or of a claim with a third look its own."""
    found: dict[Names, int] = {}
    for report in reports:
        looks = [look.n for look in report.attainable]
        if report.verdict and report.outcome in (Outcome.SUPPORTED, Outcome.REFUTED, Outcome.SMALLER):
            looks = [report.verdict.n]  # no later look follows
        for names in _read([report]):
            found[names] = max([found.get(names, tier.design.last.n), *looks])
    return found


def _conditions(
    tier: Tier,
    store: Store,
    used: Sequence[Names],
    counts: Counts,
    paces: dict[Names, Pace | None],
    limit: float,
) -> Table:
    """Build the table of conditions; steps and times are upper bounds, since a trial that has solved all levels stops.

    Trials that ran out of less time than `limit` (seconds) count as missing, too.
    """
    table = plain_table(("condition", "cached", "missing", "environment\nsteps", "time,\nat most"), ())
    steps, seconds, unknown = 0, 0.0, False
    for names in used:
        condition, seeds = tier.condition(*names), tier.design.seeds(counts[names])
        missing = len(StoredTrials(store, condition, time_limit=limit).missing(seeds))
        owed = missing * condition.environment_steps
        pace = paces[names]
        time = 0.0 if not missing else None if pace is None else pace.seconds(condition, missing)
        table.add_row(
            " on ".join(names),
            str(len(seeds) - missing),
            str(missing),
            f"{owed:,}",
            "unknown" if time is None else duration(time),
        )
        steps, seconds, unknown = steps + owed, seconds + (time or 0.0), unknown or time is None
    whole = "unknown" if unknown and not seconds else duration(seconds) + AND_MORE * unknown
    table.add_row("total", "", "", f"{steps:,}", whole, style="bold")
    return table


def _print_spent(console: PlainSpokenConsole, tier: Tier, costs: Costs, counts: Counts) -> None:
    """Print what the reference trials of conditions took, how to read that, and which are missing; nothing without any.

    The table is apart from that of conditions, so that each fits a terminal of 80 columns.
    """
    if not any(cost.trials or cost.core_pace for cost in costs.values()):
        return
    console.print(
        "\nMeasured on the committed reference trials: what they took, with compiling. Estimated from them: the hours "
        "of a CPU's core that all trials' whole budgets would take, at the pace of that method and task at any tier."
    )
    console.print_whole(_spent(tier, costs, counts))
    n = tier.design.last.n
    few = [f"{' on '.join(names)} ({cost.trials})" for names, cost in costs.items() if cost.trials < n]
    if few and any(cost.trials for cost in costs.values()):
        console.print(f"Fewer than {n} reference trials: {', '.join(few)}.")


def _spent(tier: Tier, costs: Costs, counts: Counts) -> Table:
    """Build the table of what the reference trials of conditions took, and would take on a CPU."""
    kinds, cores = _kinds(costs), any(cost.core_pace for cost in costs.values())
    table = plain_table(("condition", *(f"took on one\n{kind}" for kind in kinds), *["CPU\ncore hours"] * cores), ())
    needed = {
        names: cost.core_seconds(counts[names] * tier.condition(*names).environment_steps)
        for names, cost in costs.items()
    }
    for names, seconds in needed.items():
        hours = [_core_hours(seconds)] * cores
        table.add_row(" on ".join(names), *(_took(costs, [names], kind) for kind in kinds), *hours)
    hours = [_core_hours(sum(filter(None, needed.values()))) + AND_MORE * (None in needed.values())] * cores
    table.add_row("total", *(_took(costs, list(costs), kind) for kind in kinds), *hours, style="bold")
    return table


def _has_run(store: Store, tier: Tier, names: Names, counts: Counts) -> bool:
    """Whether the store has a trial of a condition that came to its end, made with the installed versions."""
    seeds = tier.design.seeds(counts[names])
    return len(StoredTrials(store, tier.condition(*names)).missing(seeds)) < len(seeds)


def _kinds(costs: Costs) -> list[str]:
    """Return the kinds of accelerators that reference trials were made on."""
    return sorted({kind for cost in costs.values() for kind in cost.seconds})


def _took(costs: Costs, names: Sequence[Names], kind: str) -> str:
    """Return the time that the reference trials of some conditions took on a kind of accelerator."""
    found = [costs[name] for name in names]
    seconds = sum(cost.seconds.get(kind, 0.0) for cost in found)
    missing = any(not cost.trials for cost in found)
    if not seconds:
        return "not run" if missing else "–"
    elsewhere = any(cost.trials and kind not in cost.seconds for cost in found)
    return duration(seconds) + AND_ELSEWHERE * elsewhere + AND_MORE * missing


def _core_hours(seconds: float | None) -> str:
    """Return hours of one core of a CPU."""
    if seconds is None:
        return "unknown"
    hours = seconds / HOUR
    return f"{hours:,.0f}" if hours >= 1 else "< 1"


def _claims(reports: Sequence[ClaimReport], costs: Costs) -> Table:
    """Build the table of claims."""
    kinds = _kinds(costs)
    took = [f"took on one\n{kind}" for kind in kinds]
    table = plain_table(("claim", "n", "α", "p for", "p\nagainst", "can\nend", *took), (), names=0)
    table.columns[0].justify = "left"
    for report in reports:
        used = [names for names in _read([report]) if names in costs]
        for look in report.attainable:
            smallest = {Outcome.SUPPORTED: look.supported, Outcome.REFUTED: look.refuted, Outcome.SMALLER: look.smaller}
            reach = [outcome.symbol for outcome, p in smallest.items() if p is not None and p <= look.alpha]
            table.add_row(
                report.name,
                str(look.n),
                f"{look.alpha:g}",
                f"{look.supported:.2g}",
                f"{look.refuted:.2g}",
                "".join(reach) or "no",
                *(_took(costs, used, kind) for kind in kinds if look is report.attainable[-1]),
            )
    return table
