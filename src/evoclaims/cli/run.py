"""`evoclaims run`: conditions without pytest, and claims under a variant of the protocol."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from evoclaims.claims.fetching import RunMissing
from evoclaims.cli.project import Project, open_project
from evoclaims.cli.stored import describe
from evoclaims.cli.terminal import terminal
from evoclaims.cli.variant_cost import to_run
from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.core.printable import printable
from evoclaims.core.raised import in_one_line
from evoclaims.judging.counting import MAX_TRIALS
from evoclaims.paper.reproduction import Tier
from evoclaims.report.live_line import LiveLine
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Condition, TrialSpec
from evoclaims.verdicts.robustness import matrix


def main(options: argparse.Namespace) -> int:
    """Run what is missing and list the trials; 1 when a condition failed, which does not stop the others."""
    project = open_project(options.storage)
    reproduction, store = project.reproduction, project.store
    tier = reproduction.tier(options.tier, options.variant)
    chosen = choose(tier, options.method, options.on)
    if options.variant:
        touched = reproduction.variants[options.variant].conditions.get(options.tier, {})
        chosen = [names for names in chosen if names in touched]
        if not chosen:
            raise UserError(
                f"The variant {options.variant} changes none of these conditions at the {options.tier} tier; it "
                f"changes: {', '.join(sorted(' on '.join(names) for names in touched)) or 'none'}."
            )
    n = options.trials if options.trials is not None else tier.design.last.n
    if not 1 <= n <= MAX_TRIALS:
        raise UserError(
            f"--trials takes 1 to {MAX_TRIALS} trials a condition (no verdict looks at more), not {n}. Further seeds "
            "are run by another call, with --first-seed."
        )
    seeds = range(options.first_seed, options.first_seed + n)
    for names in chosen[:1]:  # an invalid seed is so for every condition: it is reported once, and nothing is run
        _ = [TrialSpec(tier.condition(*names), seed) for seed in seeds]
    line = LiveLine(*terminal())
    fetch = RunMissing(store, options.device, line, project.config.seconds(options.time_limit))
    fetch.check()
    if options.retry:
        for names in chosen:
            condition = tier.condition(*names)
            store.forget_timeouts((TrialSpec(condition, seed).id for seed in seeds), condition.versions)
    if options.variant and not (options.method and options.on):
        chosen = to_run(project, options.variant, options.tier, chosen, seeds, options.device)
    named = [(f"{' on '.join(names)} ({options.tier})", tier.condition(*names)) for names in chosen]
    failed = 0
    for name, condition, results in run_each(named, seeds, fetch, line, project.config.root):
        if results is None:
            failed += 1
            continue
        print(name)
        again = len(fetch.again.get(condition.id, ()))
        if again:
            print(f"  {again} of these were run again, since the stored ones were made with other versions")
        for result in results:
            print(f"  {describe(result)}")
    if failed and len(chosen) > 1:
        print(f"evoclaims: {failed} of {len(chosen)} conditions failed.", file=sys.stderr)
    if options.variant:
        _print_matrix(project, options.tier, options.variant)
    return int(failed > 0)


def run_each(
    conditions: Iterable[tuple[str, Condition]], seeds: Sequence[int], fetch: RunMissing, line: LiveLine, root: Path
) -> Iterator[tuple[str, Condition, Sequence[TrialResult] | None]]:
    """Run conditions one after the other; an error in one is printed in a line and does not stop the others.

    Yields:
        Each condition's name, the condition, and its trials, or None for one that failed.
    """
    for name, condition in conditions:
        try:
            with contextlib.closing(line):
                results = fetch(condition, seeds)
        except (KeyboardInterrupt, BrokenPipeError):  # the user, or the reader of the output, has stopped
            raise
        except BaseException as error:  # an error in a method or a task must not stop the other conditions
            print(f"evoclaims: {name} failed: {printable(in_one_line(error, root))}.", file=sys.stderr)
            yield name, condition, None
            continue
        yield name, condition, results


def _print_matrix(project: Project, tier: str, variant: str) -> None:
    """Print how claims end under the protocol and under a variant of it."""
    plain, varied = project.judge_variants([(tier, ""), (tier, variant)])
    rows = matrix(plain, {variant: varied})
    print(f"\n{variant}: {project.reproduction.variants[variant].says}")
    for row in rows:
        for name, outcome in row.outcomes.items():
            changed = f"{row.plain} -> {outcome}" if name in row.hangs_on else f"{outcome} either way"
            print(f"  {row.claim}: {changed}")
    if not rows:
        print("  No claim can be judged yet: each needs all trials of its tier.")


def choose(tier: Tier, method: str | None, task: str | None) -> list[tuple[str, str]]:
    """Return the conditions that a method and a task select; an error for an unknown name lists the known ones.

    An `optional` method, which needs packages that may not be installed, runs only when it is named.
    """
    if method is not None and task is not None:
        tier.condition(method, task)
    known = list(tier.conditions)
    for name, position, kind in ((method, 0, "method"), (task, 1, "task")):
        if name is not None and name not in {names[position] for names in known}:
            raise UnknownNameError(kind, name, {names[position] for names in known})
    if method is None:
        known = [names for names in known if not getattr(tier.conditions[names].method, "optional", False)]
    return [names for names in known if method in (None, names[0]) and task in (None, names[1])]
