"""`evoclaims mutants`: which planted faults the claims of a tier notice."""

from __future__ import annotations

import argparse
import shutil
import sys
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from evoclaims.cli.project import Project, open_project
from evoclaims.cli.running import Execution
from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.core.files import write_atomically
from evoclaims.execution.job import Job, jobs
from evoclaims.execution.worker import Ended, WorkOrder
from evoclaims.judging.verdict import Outcome
from evoclaims.mutants.mutant import Planted, load, plantings
from evoclaims.mutants.trying import Comparison, merged, noticed, under_faults
from evoclaims.trials.spec import Condition
from evoclaims.verdicts import mutation_matrix
from evoclaims.verdicts.claim_report import ClaimReport, Tried
from evoclaims.verdicts.history import key_of
from evoclaims.verdicts.mutation_matrix import Fate, Sensitivity, score
from evoclaims.verdicts.other_code import edits


def main(options: argparse.Namespace) -> int:
    """Run the tier under each fault, judge its claims, and write what they notice; 1 when a condition failed."""
    project = open_project(options.storage)
    tier = project.reproduction.tier(options.tier)
    claims = project.judge(options.tier)
    used = {(source.method, source.task) for report in claims for source in report.sources}
    if not used:
        raise UserError(f"No claim of the {options.tier} tier reads trials, so no fault could change a verdict.")
    every = plantings(
        {names: one for names, one in tier.conditions.items() if names in used}, load(project.reproduction)
    )
    planted = _chosen(every, options)
    failed: tuple[Ended, ...] = ()
    if not options.stored:
        asked = {
            (source.method, source.task)
            for report in claims
            if any(one.touching(report) for one in planted)
            for source in report.sources
        }
        wanted = jobs({names: tier.condition(*names) for names in sorted(asked)}, planted)
        failed = _run(project, wanted, options)
        claims = project.judge(options.tier)
    if not any(report.n for report in claims):
        raise UserError(
            f"No claim of the {options.tier} tier is judged yet, so no fault could change a verdict. "
            f"Judge them with `pytest -m {options.tier}{project.store.pytest_option}`, or run what is missing with "
            f"`evoclaims mutants{project.store.option}` without --stored."
        )
    comparison = Comparison(project.archive, project.reproduction, options.tier, frozenset(used))
    comparison.check(planted)
    mutated = replace(project, reproduction=under_faults(project.reproduction, options.tier, planted))
    reports = mutated.judge_variants([(options.tier, one.name) for one in planted])
    broken = {(one.job.fault, one.job.names) for one in failed if not one.untried}
    path = project.reproduction.folder / mutation_matrix.FILE
    before = mutation_matrix.load(path)
    matrix = merged(
        before,
        noticed(comparison, claims, planted, reports, broken),
        options.tier,
        {key_of(report): [one.name for one in every if one.touching(report)] for report in claims if report.has_test},
    )
    write_atomically(path, mutation_matrix.dump(matrix).encode())
    for (on, claim), row in sorted(matrix.items()):
        if on == options.tier:
            print("\n".join(_told(claim, row)))
    for line in (*_errors(claims, planted, reports), *edits([report for several in reports for report in several])):
        print(f"evoclaims: {line}", file=sys.stderr)
    ends = "is as it was" if matrix == before else "is written: look at the changes and commit them"
    print(f"{score(matrix, options.tier)}\n{path} {ends}")
    return int(bool(failed))


def _chosen(every: Sequence[Planted], options: argparse.Namespace) -> list[Planted]:
    """Return the requested faults.

    Raises:
        UserError: when no fault can be planted, or for an unknown fault, method or task.
    """
    if not every:
        raise UserError(
            f"No fault can be planted: the trials that the {options.tier} tier's claims read are "
            "imported, or come from training loops."
        )
    for wanted, kind, known in (
        (options.mutant, "mutant", {one.mutant for one in every}),
        (options.of, "method or task", {one.target for one in every}),
    ):
        if wanted is not None and wanted not in known:
            raise UnknownNameError(kind, wanted, known)
    chosen = [one for one in every if options.mutant in (None, one.mutant) and options.of in (None, one.target)]
    if not chosen:
        targets = ", ".join(one.target for one in every if one.mutant == options.mutant)
        raise UserError(f"{options.mutant} is no fault of {options.of}. It can be planted in: {targets}.")
    return chosen


def _run(project: Project, wanted: Mapping[Job, Condition], options: argparse.Namespace) -> tuple[Ended, ...]:
    """Run conditions that lack trials, and return how those ended that have failed."""
    design = project.reproduction.tier(options.tier).design
    order = WorkOrder(options.storage, options.tier, options.device, design.first_seed, design.last.n)
    running = Execution(project, order, options.host)
    running.check()
    failed = tuple(ended for ended in running.run(wanted, lambda text: None) if ended.error)
    if failed:
        print(f"evoclaims: {len(failed)} of {len(wanted)} conditions failed.", file=sys.stderr)
    untried = sum(ended.untried for ended in failed)
    if untried:
        print(
            f"evoclaims: {untried} of them could not be tried, and {mutation_matrix.FILE} keeps what it says of them.",
            file=sys.stderr,
        )
    return failed


def _errors(
    sound: Sequence[ClaimReport], planted: Sequence[Planted], faulty: Sequence[Sequence[ClaimReport]]
) -> Iterator[str]:
    """Yield a line on each fault that makes claims an error or leaves them without time, which is broken."""
    judged = {key_of(report) for report in sound if report.outcome.judged}
    for one, several in zip(planted, faulty, strict=True):
        reasons: dict[str, list[str]] = {}
        for report in several:
            if (report.wants_time or report.outcome is Outcome.ERROR) and key_of(report) in judged:
                reasons.setdefault(report.reason, []).append(key_of(report)[1])
        for reason, names in reasons.items():
            yield f"{one.name}: {', '.join(names)} cannot be judged: {reason}"


def _told(claim: str, row: Sensitivity) -> Iterator[str]:
    """Yield the lines on what a claim notices: for each fate of faults, those of each method and task."""
    yield f"{claim} ({row.outcome}){f': {row.tried}' * (row.tried is Tried.INSENSITIVE)}"
    width = shutil.get_terminal_size().columns
    for fate in Fate:
        names = row.named(fate)
        found: dict[str, list[str]] = {}
        for target, _, mutant in (name.partition(": ") for name in names):
            found.setdefault(target, []).append(mutant)
        if names:
            yield f"  {len(names)} {fate}"
        for target, mutants in found.items():
            yield textwrap.fill(
                f"{target}: {', '.join(mutants)}",
                width,
                initial_indent=" " * 4,
                subsequent_indent=" " * 6,
                break_long_words=False,
                break_on_hyphens=False,
            )
    if row.untried:
        yield f"  {len(row.untried)} not tried"
    elif row.unnoticed:
        yield f"  no fault of {' or '.join(row.unnoticed)} changes it"
