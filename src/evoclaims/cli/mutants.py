"""`evoclaims mutants`: which planted faults the claims of a tier notice."""

from __future__ import annotations

import argparse
from dataclasses import replace

from evoclaims.claims.fetching import RunMissing
from evoclaims.cli.project import open_project
from evoclaims.cli.run import run_each
from evoclaims.cli.terminal import terminal
from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.core.files import write_atomically
from evoclaims.mutants.mutant import MUTANTS
from evoclaims.mutants.trying import Comparison, Planted, merged, noticed, plantings, under_faults
from evoclaims.paper.variant import Conditions
from evoclaims.report.live_line import LiveLine
from evoclaims.verdicts import mutation_matrix
from evoclaims.verdicts.mutation_matrix import Fate, Sensitivity


def main(options: argparse.Namespace) -> int:
    """Run the tier under each fault, judge its claims, and write what they notice; 1 when a condition failed."""
    project = open_project(options.storage)
    tier = project.reproduction.tier(options.tier)
    sound = project.judge(options.tier)
    used = frozenset((source.method, source.task) for report in sound if report.n for source in report.sources)
    if not used:
        raise UserError(
            f"No claim of the {options.tier} tier is judged yet, so that no fault could change a verdict: "
            f"`pytest -m {options.tier}` judges them."
        )
    planted = _planted(options, {names: one for names, one in tier.conditions.items() if names in used})
    line = LiveLine(*terminal())
    fetch = RunMissing(project.store, options.device, line, project.config.seconds(None))
    fetch.check()
    faulty = [
        (f"{' on '.join(names)}, {one.name}", condition)
        for one in planted
        for names, condition in one.conditions.items()
    ]
    seeds = tier.protocol.seeds(tier.protocol.last.n)
    failed = [name for name, _, results in run_each(faulty, seeds, fetch, line, project.config.root) if results is None]
    mutated = replace(project, reproduction=under_faults(project.reproduction, options.tier, planted))
    reports = mutated.judge_variants([(options.tier, one.name) for one in planted])
    comparison = Comparison(project.archive, project.reproduction, options.tier, used)
    path = project.reproduction.folder / mutation_matrix.FILE
    matrix = merged(mutation_matrix.load(path), noticed(comparison, sound, planted, reports))
    write_atomically(path, mutation_matrix.dump(matrix).encode())
    for (on, claim), row in matrix.items():
        if on == options.tier and row.attempts:
            print(f"{claim} ({row.outcome}): {_told(row)}")
    print(f"{mutation_matrix.score(matrix, options.tier)}\nwrote {path}: look at the changes and commit them")
    return int(bool(failed))


def _planted(options: argparse.Namespace, sound: Conditions) -> tuple[Planted, ...]:
    """Return the requested faults, in the conditions that claims use.

    Raises:
        UnknownNameError: for an unknown fault, method or task.
    """
    if options.mutant is not None and options.mutant not in MUTANTS:
        raise UnknownNameError("mutant", options.mutant, MUTANTS)
    planted = plantings(sound, {name: one for name, one in MUTANTS.items() if options.mutant in (None, name)})
    targets = {one.target for one in planted}
    if options.of is not None and options.of not in targets:
        raise UnknownNameError("method or task", options.of, targets)
    return tuple(one for one in planted if options.of in (None, one.target))


def _told(row: Sensitivity) -> str:
    """Return a line on what a claim notices."""
    found = [f"{len(row.named(one))} {one} ({', '.join(row.named(one))})" for one in Fate if row.named(one)]
    return f"{'changed by none of those tried; ' * row.insensitive}{'; '.join(found)}"
