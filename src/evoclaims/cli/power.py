"""`evoclaims power`: with which probability each claim of a tier ends as it is expected to, from a pilot."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Mapping, Sequence
from typing import Final

from evoclaims.claims.power import ClaimPower, Pilots, only, with_test
from evoclaims.cli.project import Project, open_project
from evoclaims.cli.running import Execution
from evoclaims.cli.terminal import styled
from evoclaims.core.errors import UserError
from evoclaims.core.packages import recorded
from evoclaims.core.printable import printable
from evoclaims.execution.job import Job
from evoclaims.execution.worker import WorkOrder
from evoclaims.judging.design import Design
from evoclaims.judging.exact import MAX_TRIALS
from evoclaims.judging.power import ENOUGH
from evoclaims.judging.verdict import Outcome
from evoclaims.paper import references
from evoclaims.paper.pilots import has_second
from evoclaims.paper.reproduction import Names
from evoclaims.report.console import PlainSpokenConsole, plain_table
from evoclaims.report.formatting import number, plural
from evoclaims.report.table_cells import NONE
from evoclaims.trials.failed import is_final
from evoclaims.trials.spec import Condition, TrialSpec
from evoclaims.verdicts import other_code
from evoclaims.verdicts.source_trials import change

_OUTCOMES: Final = tuple(outcome for outcome in Outcome if outcome.judged)

FIRST_SEEDS: Final = {False: 100, True: 150}
"""Of the first pilot, and of the second."""

HEADINGS: Final = ("claim", "expected", "power", "95%", *(one.symbol for one in _OUTCOMES), "flips", "needs")


def cells(one: ClaimPower) -> tuple[str, ...]:
    """Return a row, a cell per heading."""
    found = one.power
    if found is None:
        return (one.name, str(one.expected), "unknown", *(NONE,) * (len(HEADINGS) - 3))
    low, high = found.interval
    needs = NONE if one.expected is Outcome.INCONCLUSIVE else f"> {found.most}"
    return (
        one.name,
        str(one.expected),
        f"{found.power:.3f}" + " below" * (not found.suffices),
        f"{low:.3f}–{high:.3f}",
        *(f"{found.share(outcome):.3f}" for outcome in _OUTCOMES),
        f"{found.flips:.3f}",
        needs if found.needed is None else str(found.needed),
    )


def about(claims: Sequence[ClaimPower], n: int, which: str) -> list[str]:
    """Say how to read the table, and how many verdicts of a run end otherwise; `which` is "first" or "second"."""
    known = [one.power for one in claims if one.power]
    if not known:
        return []
    missed, flipped = sum(1 - found.power for found in known), sum(found.flips for found in known)
    below = sum(not found.suffices for found in known)
    outcomes = ", ".join(f"{outcome.symbol} {outcome}" for outcome in _OUTCOMES)
    return [
        f"Power: the share of {known[0].draws:,} draws of {plural(n, 'trial')} a condition, with replacement from its "
        f"{which} pilot, in which the claim ends as expected ({outcomes}); flips: in which it ends the other way; "
        f"needs: about how many trials {ENOUGH:g} takes. The interval is what draws leave open, not the pilot's size.",
        f"Of {plural(len(known), 'verdict')} of a run, {number(missed)} end otherwise than expected on average, "
        f"{number(flipped)} of them the other way. {plural(below, 'claim')} below {ENOUGH:g}.",
    ]


def troubles(claims: Sequence[ClaimPower]) -> list[str]:
    """Return a line for each claim whose power is unknown."""
    return [f"{one.name}: {one.trouble}" for one in claims if one.trouble]


def main(options: argparse.Namespace) -> int:
    """Print the power of each claim; 1 when one is below 0.95 or unknown, or a condition failed."""
    project = open_project(options.storage)
    design = project.reproduction.tier(options.tier).design
    if options.draws < 1:
        raise UserError(f"--draws takes a number from 1 up, not {options.draws}.")
    (collected,) = project.collect([("", options.tier)])
    every = with_test(collected)
    chosen = only(every, options.only)
    which = options.pilot or ("second" if has_second(project.reproduction.folder, options.tier) else "first")
    pilots = Pilots(project.reproduction, options.tier, every, second=which == "second")
    wanted = {names: group.condition for one in chosen for names, group in one.groups.items()}
    if options.run or options.stored:
        _make(project, pilots, {names: one for names, one in wanted.items() if pilots.unfit(names)}, design, options)
    powers = pilots.powers(chosen, options.draws)
    imported = bool(wanted) and all(condition.existing for condition in wanted.values())
    advice = [] if imported else [_advice(options)]
    if not any(one.power for one in powers):
        first = "; ".join(troubles(powers)[:1]) or "no claim has a test"
        raise UserError(" ".join([f"No power can be computed at the {options.tier} tier: {first}.", *advice]))
    console = PlainSpokenConsole(file=styled())
    console.print_whole(plain_table(HEADINGS, map(cells, powers)))
    for sentence in (*about(powers, design.last.n, which), *troubles(powers)):
        console.print(sentence)
    for names, condition in wanted.items():
        for name in () if pilots.unfit(names) else condition.edited_since(pilots.trials[names]):
            print(printable(f"{' on '.join(names)}: {other_code.summary(name)}"))
    for sentence in _versions(pilots, wanted):
        print(sentence)
    if advice and troubles(powers):
        print(*advice, file=sys.stderr)
    return int(not all(one.suffices for one in powers))


def _make(
    project: Project,
    pilots: Pilots,
    wanted: Mapping[Names, Condition],
    design: Design,
    options: argparse.Namespace,
) -> None:
    """Make the pilots that are missing: run their trials unless they are stored, and write each that is complete."""
    first_seed = options.first_seed if options.first_seed is not None else FIRST_SEEDS[pilots.second]
    seeds = range(first_seed, first_seed + options.trials)
    if not design.last.n <= options.trials <= MAX_TRIALS:
        raise UserError(
            f"--trials takes {design.last.n} (as many as a verdict reads) to {MAX_TRIALS} trials per "
            f"condition, not {options.trials}."
        )
    drift = project.reproduction.tier(options.tier).for_drift
    own = design.seeds(max(design.with_third_look().last.n, design.last.n + max(drift.values(), default=0)))
    if set(seeds) & set(own):
        raise UserError(
            f"The seeds {seeds[0]} to {seeds[-1]} overlap the {options.tier} tier's own "
            f"({own[0]} to {own[-1]}), and a pilot must not use trials "
            "that verdicts read. Choose other seeds with --first-seed."
        )
    taken = {trial.seed for names in wanted for trial in pilots.other(names)} & set(seeds)
    if taken:
        raise UserError(
            f"The seeds {seeds[0]} to {seeds[-1]} overlap those of the other pilot ({min(taken)} to {max(taken)}), and "
            "no trial is in both. Choose other seeds with --first-seed."
        )
    for condition in list(wanted.values())[:1]:  # an invalid seed is so for every condition: it is reported at once
        _ = [TrialSpec(condition, seed) for seed in seeds]
    if options.stored:
        for names, condition in wanted.items():
            _write(project, pilots, names, condition, seeds)
        return
    order = WorkOrder(options.storage, options.tier, options.device, seeds[0], options.trials)
    running = Execution(project, order, options.host)
    if wanted:
        running.check()
    for ended in running.run({Job("", *names): one for names, one in wanted.items()}, lambda text: print(f"  {text}")):
        if not ended.error:
            _write(project, pilots, ended.job.names, wanted[ended.job.names], seeds)


def _write(project: Project, pilots: Pilots, names: Names, condition: Condition, seeds: Sequence[int]) -> None:
    stored = [record for seed in seeds for record in project.store.records(TrialSpec(condition, seed).id)]
    trials = references.of_one_environment([*filter(is_final, stored)], condition, seeds, len(seeds))
    if not trials:
        return
    if len(trials) < len(seeds):
        print(
            f"left alone: {' on '.join(names)}: {len(trials)} of {len(seeds)} trials are stored, counted from seed "
            f"{seeds[0]}, of one environment and not out of time"
        )
        return
    print(f"wrote {pilots.write(names, trials)}: {len(trials)} trials")


def _versions(pilots: Pilots, wanted: Mapping[Names, Condition]) -> list[str]:
    """Say which pilots were made with other versions than are installed."""
    by_change: dict[str, list[str]] = {}
    for names, condition in wanted.items():
        made = {} if pilots.unfit(names) else recorded(pilots.trials[names][0].provenance, condition.packages)
        moved = change(made, condition.versions) if made else ""
        if moved:
            by_change.setdefault(moved, []).append(" on ".join(names))
    return [
        f"Made with other versions than are installed ({moved}): {', '.join(by_change[moved])}" for moved in by_change
    ]


def _advice(options: argparse.Namespace) -> str:
    chosen = f" --tier {options.tier}" * (options.tier != "smoke")
    chosen += f" --pilot {options.pilot}" * bool(options.pilot)
    chosen += "" if options.only is None else f" --only {shlex.quote(options.only)}"
    return f"`evoclaims power{chosen} --run` runs and writes the pilots that are missing."
