"""`evoclaims reference`: stored trials become the committed reference trials."""

from __future__ import annotations

import argparse

from evoclaims.cli.project import open_project
from evoclaims.core.errors import UserError
from evoclaims.core.files import write_atomically
from evoclaims.core.packages import recorded
from evoclaims.core.printable import printable
from evoclaims.judging.drift import MIN_REFERENCES
from evoclaims.judging.verdict import Outcome
from evoclaims.paper import references
from evoclaims.paper.reproduction import Names, Reproduction, Tier
from evoclaims.trials.failed import is_final
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import TrialSpec
from evoclaims.verdicts.other_code import summary
from evoclaims.verdicts.source_trials import change


def main(options: argparse.Namespace) -> int:
    """Write one file per condition that the tier's claims use and the store holds enough trials of.

    A variant's condition that is committed under another name, and not under its own, is reported and not written.
    """
    project = open_project(options.storage)
    reproduction, store = project.reproduction, project.store
    tier = reproduction.tier(options.tier, options.variant)
    (reports,) = project.judge_variants([(options.tier, options.variant)])
    for report in reports:
        if report.outcome is Outcome.ERROR and not report.sources:  # such as a damaged record: what it reads is unknown
            print(printable(f"left alone: what {report.name} alone reads, which is error now: {report.reason}"))
    used = sorted(_with_null_agents(reproduction, tier, {(s.method, s.task) for r in reports for s in r.sources}))
    if options.variant:
        changes = reproduction.changed_by(options.variant, options.tier)
        used = [names for names in used if names in changes]
    # A claim is judged after each look; the drift check needs MIN_REFERENCES trials.
    looks = [look.n for look in tier.design.looks[:-1]]
    third = {
        names: report.attainable[-1].n
        for report in reports
        if report.attainable and report.attainable[-1].n > tier.design.last.n
        for names in _with_null_agents(reproduction, tier, {(s.method, s.task) for s in report.sources})
    }
    written, shared, unknown = 0, 0, list[str]()
    for method, task in used:
        sizes = [*looks, max(tier.design.last.n, MIN_REFERENCES), *filter(None, [third.get((method, task))])]
        condition = tier.condition(method, task)
        places = references.by_variant(reproduction.references, options.tier, method, task, condition.id)
        if options.variant and places and options.variant not in places:
            shared += 1
            under = " and ".join(name or "the protocol itself" for name in places)
            print(f"left alone: {method} on {task}: the same condition as under {under}, committed there")
            continue
        seeds = tier.design.seeds(sizes[-1], bool(condition.existing))
        path = references.path_of(reproduction.references_of(options.variant), options.tier, method, task)
        there = references.load(path)
        committed = [trial for trial in there if trial.condition == condition.id]
        stored = [record for seed in seeds for record in store.records(TrialSpec(condition, seed).id)]
        if not stored:
            continue
        results = references.of_one_environment([*committed, *filter(is_final, stored)], condition, seeds, sizes[0])
        size = max((size for size in sizes if size <= len(results)), default=0)
        needed = max(len(committed), sizes[0])
        if size < needed:
            print(
                f"left alone: {method} on {task}: {len(results)} of {needed} trials are stored or committed, counted "
                "from the first seed and of one environment"
            )
            continue
        if not options.unknown_revision and any(map(_is_of_unknown_revision, results[:size])):
            unknown.append(f"{method} on {task}")
            continue
        references.write(path, results[:size])
        written += 1
        for trial in results[:size] if options.champions else ():
            if store.has_champion(trial):
                place = references.champion_path(reproduction.references, options.tier, trial)
                write_atomically(place, store.packed_champion(trial))
        upgraded = change(recorded(results[0].provenance, condition.packages), condition.versions)
        gone = len(there) - len(committed)
        print(
            f"wrote {path}: {size} trials"
            + (
                f", in place of {gone} of another condition (its settings, budget or revision were others)"
                if gone
                else ""
            )
            + (f", made with other versions than are installed: {upgraded}" if upgraded else "")
        )
        dirty = sum(bool((trial.provenance.get("git") or {}).get("dirty")) for trial in results[:size])
        if dirty:
            print(f"  {dirty} of them ran code with uncommitted changes: nobody may be able to run that code again")
        written_seeds = {trial.seed for trial in results[:size]}
        left = {record.seed for record in stored if is_final(record)} - written_seeds
        if left:
            print(
                f"  left alone of those stored: {len(left)}, made with other versions than these, or more than a claim "
                "looks at"
            )
        for name in condition.edited_since(results[:size]):
            print(f"  {printable(summary(name))}")
    if unknown:
        raise UserError(
            f"Trials of {', '.join(unknown)} ran code of an unknown revision: there was no git "
            "repository, or no commit. Nobody could run that code again. Commit the project and run the "
            "trials again in an empty store, or keep them with --unknown-revision."
        )
    if not (written or (used and shared == len(used))):
        variant, smallest = options.variant, [*looks, max(tier.design.last.n, MIN_REFERENCES)][0]
        of, named = (f" that {variant} changes", f" --variant {variant}") if variant else ("", "")
        raise UserError(
            f"No {'other ' * bool(shared)}condition of the {options.tier} tier{of} has {smallest} stored trials; run "
            f"them first with `evoclaims run --tier {options.tier}{named}{project.store.option}`."
        )
    return 0


def _with_null_agents(reproduction: Reproduction, tier: Tier, used: set[Names]) -> set[Names]:
    """Return conditions of claims, and of the null agents with trials of their own that these are put to."""
    agents, tasks = {agent.method for agent in reproduction.null_agents.values()}, {task for _, task in used}
    return used | {(method, task) for method, task in tier.conditions if method in agents and task in tasks}


def _is_of_unknown_revision(trial: TrialResult) -> bool:
    """Whether a trial of the project's own does not record which commit made it."""
    return "imported" not in trial.provenance and not (trial.provenance.get("git") or {}).get("sha")
