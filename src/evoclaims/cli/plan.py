"""`evoclaims plan`: what a tier would run, what it costs here, and what its verdicts can show."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from rich.markup import escape
from rich.table import Table

from evoclaims.cli.project import open_project
from evoclaims.cli.terminal import styled
from evoclaims.core.errors import UserError
from evoclaims.judging.verdict import Outcome
from evoclaims.paper.cost import Pace, known_pace, measured_pace
from evoclaims.paper.reproduction import Tier
from evoclaims.report.console import PlainSpokenConsole
from evoclaims.report.live_line import duration
from evoclaims.trials import devices
from evoclaims.trials.spec import Condition, TrialSpec
from evoclaims.trials.store import Store
from evoclaims.trials.time_limit import answers
from evoclaims.verdicts.claim_report import ClaimReport


def main(options: argparse.Namespace) -> int:
    """Print conditions with their cost, then claims with their attainable p."""
    project = open_project(options.storage)
    reproduction, store = project.reproduction, project.store
    tier = reproduction.tier(options.tier)
    chosen = devices.choose(options.device)
    kind = options.like or chosen[0].device_kind
    reports = project.judge(options.tier)
    used = sorted({(source.method, source.task) for report in reports for source in report.sources})

    def pace(condition: Condition, method: str, task: str) -> Pace | None:
        known = known_pace(condition, store, reproduction.references, options.tier, method, task, kind)
        return measured_pace(condition, chosen) if known is None and options.measure else known

    paces = {names: pace(tier.condition(*names), *names) for names in used}
    if options.like and not any(paces.values()):
        raise UserError(f"No trial of the {options.tier} tier at hand was made on a device called {options.like!r}.")
    console = PlainSpokenConsole(file=styled())
    where = f"as they took on one {kind}" if options.like else f"on {len(chosen)} × {kind}"
    console.print(escape(f"Conditions of the {options.tier} tier, {where}"))
    console.print(_conditions(tier, store, used, paces, project.config.seconds(None)))
    console.print(f"\nClaims: the smallest p that the protocol allows (n trials a side, α {tier.protocol.alpha:g})")
    console.print(_claims(reports))
    if any(pace is None for pace in paces.values()):
        console.print("\nTimes are unknown where no trial has run on such a device; --measure times a few steps.")
    return 0


def _conditions(
    tier: Tier,
    store: Store,
    used: Sequence[tuple[str, str]],
    paces: dict[tuple[str, str], Pace | None],
    limit: float,
) -> Table:
    """Build the table of conditions; steps and times are upper bounds, since a trial that has solved all levels stops.

    Trials that ran out of less time than `limit` (seconds) count as missing, too.
    """
    table = Table(box=None, pad_edge=False)
    for heading in ("condition", "cached", "missing", "environment steps", "time, at most"):
        table.add_column(heading, justify="left" if heading == "condition" else "right")
    seeds = tier.protocol.seeds(tier.protocol.last.n)
    steps, seconds, unknown = 0, 0.0, False
    for names in used:
        condition = tier.condition(*names)
        versions = condition.versions
        stored = (store.made_with(TrialSpec(condition, seed).id, versions) for seed in seeds)
        missing = sum(not answers(result, limit) for result in stored)
        owed = missing * condition.environment_steps
        pace = paces[names]
        time = 0.0 if not missing else None if pace is None else pace.seconds(condition, missing)
        table.add_row(
            escape(f"{names[0]} on {names[1]}"),
            str(len(seeds) - missing),
            str(missing),
            f"{owed:,}",
            "unknown" if time is None else duration(time),
        )
        steps, seconds, unknown = steps + owed, seconds + (time or 0.0), unknown or time is None
    table.add_row("total", "", "", f"{steps:,}", duration(seconds) + (" and more" if unknown else ""), style="bold")
    return table


def _claims(reports: Sequence[ClaimReport]) -> Table:
    """Build the table of claims."""
    table = Table(box=None, pad_edge=False)
    for heading in ("claim", "n", "α", "p for", "p against", "can be decided"):
        table.add_column(heading, justify="left" if heading == "claim" else "right")
    for report in reports:
        for look in report.attainable:
            smallest = {Outcome.SUPPORTED: look.supported, Outcome.REFUTED: look.refuted}
            reach = [outcome for outcome, p in smallest.items() if p <= look.alpha]
            table.add_row(
                escape(report.name),
                str(look.n),
                f"{look.alpha:g}",
                f"{look.supported:.2g}",
                f"{look.refuted:.2g}",
                " or ".join(reach) or "no",
            )
    return table
