"""`evoclaims plan`: what a tier would run, what it costs here, and what its verdicts can show."""

from __future__ import annotations

import argparse
import sys
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

from rich.table import Table

from evoclaims.claims.fetching import NotStoredError, StoredOnly, more_for_drift
from evoclaims.cli.project import open_project
from evoclaims.cli.terminal import styled
from evoclaims.core.errors import UserError, in_one_line
from evoclaims.core.printable import printable
from evoclaims.envs.base import Checked
from evoclaims.judging.verdict import Outcome
from evoclaims.paper import references
from evoclaims.paper.cost import Estimator, Owed, Wanted, measured, took
from evoclaims.paper.reproduction import Names, Tier
from evoclaims.report.console import PlainSpokenConsole, plain_table
from evoclaims.report.live_line import duration
from evoclaims.trials import devices
from evoclaims.trials.imported import where_from
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Condition
from evoclaims.trials.store import DamagedFileError
from evoclaims.verdicts.claim_report import ClaimReport

Counts = Mapping[Names, int]
"""Most trials of each condition that claims may need, by method and task."""

Costs = Mapping[Names, Sequence[TrialResult]]
"""The reference trials of conditions, by method and task."""

AND_ELSEWHERE: Final = "\n+ elsewhere"
"""Follows a sum without conditions whose trials ran on other devices."""

AND_MORE: Final = "\nand more"
"""Says of a sum that some of it is unknown; on a line of its own, so that the column stays narrow."""


def main(options: argparse.Namespace) -> int:
    """Print conditions with their cost, then claims with their attainable p; 1 when a step cannot be timed.

    Raises:
        UserError: when a task is refused (`Checked`).
    """
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
    used = [names for names in read if not tier.condition(*names).existing]
    for names in used:
        task = tier.condition(*names).task
        if isinstance(task, Checked):
            task.check()

    counts, untimed = _counts(tier, reports), list[str]()
    platform = chosen[0].platform
    if options.like:
        platform = "cpu" if options.like == "cpu" else "gpu"
    limit = project.config.seconds(None)
    wanted: dict[Names, Wanted] = {}
    for names in used:
        condition, seeds = tier.condition(*names), tier.design.seeds(counts[names])
        for_drift = more_for_drift(reproduction.seeds_for_drift, condition.id, seeds, limit, platform)
        wanted[names] = Wanted(names, condition, [*seeds, *for_drift])
    estimator = Estimator(store, reproduction, options.tier, platform, options.like or "", limit)
    owed = estimator.owed(wanted)
    if options.measure:
        for names, one in owed.items():
            condition = wanted[names].condition
            if one.cost.basis == "budget" and condition.loop is None:  # which has no steps
                try:
                    owed[names] = replace(one, cost=measured(condition, chosen, one.cost.trials))
                except KeyboardInterrupt:
                    raise
                except BaseException as error:  # an error in a method or a task must not hide the others
                    reason = in_one_line(error, project.config.root)
                    untimed.append(f"{' on '.join(names)} cannot be timed: {reason}.")
    bases = [one.cost.basis for one in owed.values()]
    if options.like and set(bases) <= {"budget"}:
        raise UserError(f"No trial of the {options.tier} tier at hand was made on a device called {options.like!r}.")
    costs = {
        names: references.of_condition(reproduction.references, options.tier, *names, tier.condition(*names).id)
        for names in read
    }
    console = PlainSpokenConsole(file=styled())
    where = f"as they took on one {kind}" if options.like else f"on {len(chosen)} × {kind}"
    under = f" that {variant} changes" if variant else ""
    console.print(f"Conditions of the {options.tier} tier{under}, {where}")
    console.print_whole(_conditions(wanted, owed))
    if more := [" on ".join(names) for names in used if counts[names] > tier.design.last.n]:
        console.print(
            f"Trials beyond {tier.design.last.n} of a condition run only where a claim with a third look is open "
            f"after them: {', '.join(more)}."
        )
    elsewhere = bases.count("elsewhere")
    if elsewhere and not options.like:
        console.print(
            f"Times of {elsewhere} of {len(used)} conditions are by trials of other machines. A trial that "
            "has solved every level stops earlier."
        )
    for names in read:
        if names not in used:
            condition, n = tier.condition(*names), counts[names]
            few = f", and the design looks at {n}" if len(condition.existing) < n else ""
            console.print(f"{' on '.join(names)}: nothing to run: {where_from(condition)}{few}")
    _print_spent(console, tier, {names: costs[names] for names in used})
    ends = ", ".join(f"{end.symbol} {end}" for end in (Outcome.SUPPORTED, Outcome.REFUTED, Outcome.SMALLER))
    console.print(
        f"\nClaims, with n trials a side and α {tier.design.alpha:g} over all looks: the smallest p for and against "
        f"them that the design allows, and the outcomes that each look can reach: {ends}, or none (no)"
    )
    if variant:
        console.print(f"The time of a claim is that of the conditions that {variant} changes.")
    console.print_whole(_claims(reports, costs))
    for report in reports:
        if report.outcome is Outcome.ERROR and not report.attainable:
            console.print(f"{report.name}: error: {report.reason}")
    if any(one.seeds and one.cost.basis == "budget" for one in owed.values()) and not untimed:
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


def _conditions(wanted: Mapping[Names, Wanted], owed: Mapping[Names, Owed]) -> Table:
    """Build the table of conditions; steps are upper bounds, since a trial that has solved all levels stops."""
    table = plain_table(("condition", "cached", "missing", "environment\nsteps", "time,\nabout"), ())
    steps, seconds, unknown = 0, 0.0, False
    for names, one in owed.items():
        missing = len(one.seeds)
        budget = missing * wanted[names].condition.environment_steps
        known = not missing or one.cost.basis != "budget"
        time = one.cost.seconds(devices.usable_cores()) if missing and known else 0.0
        cells = (str(len(wanted[names].seeds) - missing), str(missing), f"{budget:,}")
        table.add_row(" on ".join(names), *cells, duration(time) if known else "unknown")
        steps, seconds, unknown = steps + budget, seconds + time, unknown or not known
    whole = "unknown" if unknown and not seconds else duration(seconds) + AND_MORE * unknown
    table.add_row("total", "", "", f"{steps:,}", whole, style="bold")
    return table


def _print_spent(console: PlainSpokenConsole, tier: Tier, costs: Costs) -> None:
    """Print what the reference trials of conditions took on accelerators, and which are missing; nothing without any.

    The table is apart from that of conditions, so that each fits a terminal of 80 columns.
    """
    if not any(costs.values()):
        return
    if kinds := _kinds(costs):
        console.print("\nMeasured on the committed reference trials: what they took, with compiling.")
        table = plain_table(("condition", *(_head([kind]) for kind in kinds)), ())
        for names in costs:
            table.add_row(" on ".join(names), *(_took(costs, [names], [kind]) for kind in kinds))
        table.add_row("total", *(_took(costs, list(costs), [kind]) for kind in kinds), style="bold")
        console.print_whole(table)
    n = tier.design.last.n
    few = [f"{' on '.join(names)} ({len(trials)})" for names, trials in costs.items() if len(trials) < n]
    if few:
        console.print(f"Fewer than {n} reference trials: {', '.join(few)}.")


def _kinds(costs: Costs) -> list[str]:
    return sorted({kind for trials in costs.values() for kind in took(trials)})


def _head(kinds: Sequence[str]) -> str:
    """Return the heading of a column of times on these kinds of accelerators."""
    kind = kinds[0] if len(kinds) == 1 else "accelerator"
    return "\n".join(["took on one", *textwrap.wrap(kind, 14)])  # two columns fit 80


def _took(costs: Costs, names: Sequence[Names], kinds: Sequence[str]) -> str:
    """Return the time that the reference trials of some conditions took on these kinds of accelerators."""
    found = {name: took(costs[name]) for name in names}
    seconds = sum(each.get(kind, 0.0) for each in found.values() for kind in kinds)
    missing = any(not costs[name] for name in names)
    if not seconds:
        return "not run" if missing else "–"
    elsewhere = any(costs[name] and each.keys().isdisjoint(kinds) for name, each in found.items())
    return duration(seconds) + AND_ELSEWHERE * elsewhere + AND_MORE * missing


def _claims(reports: Sequence[ClaimReport], costs: Costs) -> Table:
    kinds = _kinds(costs)
    heads = [_head(kinds)] if kinds else []  # one for all kinds, so that it fits 80 columns
    table = plain_table(("claim", "n", "α", "p for", "p\nagainst", "can\nend", *heads), (), names=0)
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
                *(_took(costs, used, kinds) for _ in heads if look is report.attainable[-1]),
            )
    return table
