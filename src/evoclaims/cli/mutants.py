"""`evoclaims mutants`: which planted faults the claims of a tier notice."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace

from evoclaims.claims.fetching import RunMissing
from evoclaims.cli.project import Project, open_project
from evoclaims.cli.run import run_each
from evoclaims.cli.terminal import terminal
from evoclaims.cli.worker import Order
from evoclaims.cli.workers import Workers, processes_of
from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.core.files import write_atomically
from evoclaims.mutants import catalogue
from evoclaims.mutants.conditions import Job, Planted, jobs, plantings, sharing_programs
from evoclaims.mutants.trying import Comparison, merged, noticed, under_faults
from evoclaims.paper import references
from evoclaims.report.live_line import LiveLine
from evoclaims.trials.spec import Condition, TrialSpec
from evoclaims.trials.time_limit import answers
from evoclaims.verdicts import mutation_matrix
from evoclaims.verdicts.history import key_of
from evoclaims.verdicts.mutation_matrix import Fate, Sensitivity
from evoclaims.verdicts.mutation_score import score
from evoclaims.verdicts.sensitivity import Tried


def main(options: argparse.Namespace) -> int:
    """Run the tier under each fault, judge its claims, and write what they notice; 1 when a condition failed."""
    processes = processes_of(options.numprocesses)
    project = open_project(options.storage)
    tier = project.reproduction.tier(options.tier)
    claims = project.judge(options.tier)
    used = {(source.method, source.task) for report in claims for source in report.sources}
    if not used:
        raise UserError(f"No claim of the {options.tier} tier reads trials, so that no fault could change a verdict.")
    every = plantings(
        {names: one for names, one in tier.conditions.items() if names in used}, catalogue.load(project.reproduction)
    )
    planted = _chosen(every, options)
    failed: frozenset[Job] = frozenset()
    if not options.stored:
        asked = {
            (source.method, source.task)
            for report in claims
            if any(one.touching(report) for one in planted)
            for source in report.sources
        }
        wanted = jobs({names: tier.condition(*names) for names in sorted(asked)}, planted)
        failed = _run(project, wanted, options, processes)
        claims = project.judge(options.tier)
    if not any(report.n for report in claims):
        raise UserError(
            f"No claim of the {options.tier} tier is judged yet, so that no fault could change a verdict: "
            f"`pytest -m {options.tier}` judges them, and `evoclaims mutants` without --stored runs what is missing."
        )
    mutated = replace(project, reproduction=under_faults(project.reproduction, options.tier, planted))
    reports = mutated.judge_variants([(options.tier, one.name) for one in planted])
    comparison = Comparison(project.archive, project.reproduction, options.tier, frozenset(used))
    path = project.reproduction.folder / mutation_matrix.FILE
    matrix = merged(
        mutation_matrix.load(path),
        noticed(comparison, claims, planted, reports, {(one.fault, one.names) for one in failed}),
        options.tier,
        {key_of(report): [one.name for one in every if one.touching(report)] for report in claims},
    )
    write_atomically(path, mutation_matrix.dump(matrix).encode())
    for (on, claim), row in sorted(matrix.items()):
        if on == options.tier:
            print(f"{claim} ({row.outcome}): {_told(row)}")
    print(f"{score(matrix, options.tier)}\nwrote {path}: look at the changes and commit them")
    return int(bool(failed))


def _chosen(every: Sequence[Planted], options: argparse.Namespace) -> list[Planted]:
    """Return the requested faults.

    Raises:
        UnknownNameError: for an unknown fault, method or task.
    """
    for wanted, kind, known in (
        (options.mutant, "mutant", {one.mutant for one in every}),
        (options.of, "method or task", {one.target for one in every}),
    ):
        if wanted is not None and wanted not in known:
            raise UnknownNameError(kind, wanted, known)
    return [one for one in every if options.mutant in (None, one.mutant) and options.of in (None, one.target)]


def _run(
    project: Project, wanted: Mapping[Job, Condition], options: argparse.Namespace, processes: int
) -> frozenset[Job]:
    """Run conditions that lack trials, and return those that still do."""
    tier, limit = project.reproduction.tier(options.tier), project.config.seconds(None)
    seeds = tier.design.seeds(tier.design.last.n)
    line = LiveLine(*terminal())
    fetch = RunMissing(project.store, options.device, line, limit)
    fetch.check()

    def lacks(one: Job) -> bool:
        condition = wanted[one]
        made = (project.store.made_with(TrialSpec(condition, seed).id, condition.versions) for seed in seeds)
        return not all(answers(result, limit) for result in made)

    groups = sharing_programs(filter(lacks, wanted), tier.conditions)
    if processes == 1:
        named = [(one.label, wanted[one]) for group in groups for one in group]
        for _ in run_each(named, seeds, fetch, line, project.config.root):
            pass
    else:
        order = Order(options.storage, options.tier, options.device, ())
        Workers(order, processes, lacks).run((group, _seconds(project, options.tier, group)) for group in groups)
    failed = frozenset(one for group in groups for one in group if lacks(one))
    if failed:
        print(f"evoclaims: {len(failed)} of {len(wanted)} conditions failed.", file=sys.stderr)
    return failed


def _seconds(project: Project, tier: str, group: Sequence[Job]) -> float:
    """Return about how long a group of conditions takes: as long as the reference trials of the sound ones took."""
    took = 0.0
    for one in group:
        trials = references.load(references.path_of(project.reproduction.references, tier, *one.names))
        took += max([1.0, *(trial.timing["run"] + trial.timing["compile"] for trial in trials)])
    return took


def _told(row: Sensitivity) -> str:
    """Return a line on what a claim notices."""
    said = [f"{len(row.named(one))} {one} ({', '.join(row.named(one))})" for one in Fate if row.named(one)]
    if row.untried:
        said.append(f"{len(row.untried)} not tried")
    elif row.unnoticed:
        said.append(f"no fault of {' or '.join(row.unnoticed)} changes it")
    return f"{f'{row.tried}; ' * (row.tried is Tried.INSENSITIVE)}{'; '.join(said)}"
