"""`evoclaims run`: conditions without pytest, and claims under a variant of the protocol."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from evoclaims.cli.project import Project, open_project
from evoclaims.cli.running import Execution, choose, trials_asked
from evoclaims.cli.stored_trial import describe
from evoclaims.execution.job import Job
from evoclaims.execution.worker import WorkOrder
from evoclaims.paper import references
from evoclaims.paper.cost import Estimator, Wanted
from evoclaims.paper.reproduction import Names
from evoclaims.report.formatting import plural
from evoclaims.report.live_line import duration
from evoclaims.trials.batches import StoredTrials
from evoclaims.trials.devices import usable_cores
from evoclaims.trials.failed import last_said
from evoclaims.trials.imported import where_from
from evoclaims.trials.result import COMPLETE
from evoclaims.trials.spec import Condition, TrialSpec
from evoclaims.trials.store import Store
from evoclaims.verdicts import other_code
from evoclaims.verdicts.claim_report import Tally
from evoclaims.verdicts.transitions import matrix


def to_run(running: Execution, names: Sequence[Names]) -> list[Names]:
    """Print what the conditions of a variant cost here, and return those that are not committed."""
    reproduction, store = running.project.reproduction, running.project.store
    tier, variant, seeds = running.order.tier, running.order.variant, running.order.seeds
    varied = reproduction.tier(tier, variant)
    wanted = {one: Wanted(one, varied.condition(*one), seeds) for one in names}
    owed = Estimator(store, reproduction, tier, running.platform, time_limit=running.limit).owed(wanted)
    chosen, seconds, unknown = [], 0.0, 0
    print(f"{variant}: {reproduction.variants[variant].says}")
    for one, lacking in owed.items():
        committed = references.of_condition(reproduction.references, tier, *one, wanted[one].condition.id)
        if lacking.seeds and {trial.seed for trial in committed if trial.status in COMPLETE} >= set(seeds):
            says = "committed, so not run; name method and task to run it here"
        else:
            chosen.append(one)
            says = "stored"
            if lacking.seeds:
                known, took = lacking.cost.basis != "budget", lacking.cost.seconds(usable_cores())
                seconds, unknown = seconds + took * known, unknown + (not known)
                about = f"about {duration(took)}" if known else "time unknown"
                says = f"{plural(len(lacking.seeds), 'trial')} to run, {about}"
        print(f"  {' on '.join(one)} ({tier}): {says}")
    more = f", and {plural(unknown, 'condition')} of unknown time" * bool(unknown)
    print(f"about {duration(seconds)} on such a device ({running.platform}){more}", flush=True)
    return chosen


def main(options: argparse.Namespace) -> int:
    """Run what is missing and list the trials; 1 when a condition failed, which does not stop the others."""
    project = open_project(options.storage)
    store = project.store
    tier, chosen = choose(project, options)
    n = trials_asked(options, tier)
    first = tier.design.first_seed if options.first_seed is None else options.first_seed
    seeds = range(first, first + n)
    for names in chosen[:1]:  # an invalid seed is so for every condition: it is reported once, and nothing is run
        _ = [TrialSpec(tier.condition(*names), seed) for seed in seeds]
    order = WorkOrder(options.storage, options.tier, options.device, seeds[0], n, options.variant, options.time_limit)
    running = Execution(project, order, options.host)
    running.check()
    if options.variant and not (options.method and options.on):
        chosen = to_run(running, chosen)
    wanted = {Job("", *names): tier.condition(*names) for names in chosen}
    for job in [job for job, condition in wanted.items() if condition.existing]:
        print(f"{job.label} ({options.tier}): nothing to run: {where_from(wanted.pop(job))}")
    if options.retry:
        for condition in wanted.values():
            StoredTrials(store, condition).forget_timeouts(seeds)
    complete = {job for job, condition in wanted.items() if not StoredTrials(store, condition).missing(seeds)}
    failed = 0
    for ended in running.run(wanted, lambda text: print(f"  {text}", flush=True)):
        name = f"{ended.job.label} ({options.tier})"
        note = ""
        if ended.again:
            note = f"{ended.again} of these were run again, since the stored ones were made with other versions"
        elif ended.job in complete:
            note = "nothing was run: all were stored"
        failed += bool(ended.error) or _print_trials(store, name, wanted[ended.job], seeds, note)
    if failed and len(chosen) > 1:
        print(f"evoclaims: {failed} of {len(chosen)} conditions failed.", file=sys.stderr)
    if options.variant:
        _print_matrix(project, options.tier, options.variant)
    return int(failed > 0)


def _print_trials(store: Store, name: str, condition: Condition, seeds: Sequence[int], note: str) -> bool:
    print(name)
    if note:
        print(f"  {note}")
    found = (store.get(TrialSpec(condition, seed).id, condition.versions) for seed in seeds)
    results = [result for result in found if result is not None]
    for name in condition.edited_since(results):
        print(f"  {other_code.summary(name)}")
    for result in results:
        print(f"  {describe(result)}")
    crashed = [result for result in results if result.status == "crashed"]
    lines = last_said(crashed[0]).splitlines() if crashed else []
    if len(lines) > 1:
        print(f"  what seed {crashed[0].seed} printed last:", *lines, sep="\n    ")
    return bool(crashed)


def _print_matrix(project: Project, tier: str, variant: str) -> None:
    plain, varied = project.judge_variants([(tier, ""), (tier, variant)])
    rows = matrix(plain, {variant: varied})
    print(f"\n{variant}: {project.reproduction.variants[variant].says}")
    for row in rows:
        for name, outcome in row.outcomes.items():
            outcomes = f"{row.plain} -> {outcome}" if name in row.hangs_on else f"{outcome} either way"
            if name in row.fewer:
                outcomes = (
                    f"{outcome}, {row.plain} under the protocol itself: too few trials, or too little time, to tell"
                )
            if row.plain is Tally.NOT_RUN:
                outcomes = f"{outcome}; not run under the protocol itself"
            print(f"  {row.claim}: {outcomes}")
    if not rows:
        print("  No claim can be judged yet: each needs all trials of its tier.")
