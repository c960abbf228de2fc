"""`evoclaims compare`: two sets of verdicts and trials, accepted and current ones, or of two stores."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain

from evoclaims.claims.fetching import StoredOnly
from evoclaims.claims.session import Session
from evoclaims.cli.project import Project, open_project
from evoclaims.cli.store_folder import open_store
from evoclaims.core.errors import UserError
from evoclaims.judging.drift_report import DigestCheck, DriftReport
from evoclaims.paper.archive import Archive
from evoclaims.trials.store import Store
from evoclaims.verdicts import comparison, transitions
from evoclaims.verdicts.comparison import Side
from evoclaims.verdicts.other_code import listed
from evoclaims.verdicts.transitions import Kind

UNSAID = (Kind.SAME, Kind.NOT_RUN)
"""Kinds that are counted but not listed."""


def main(options: argparse.Namespace) -> int:
    """Print what changed; 1 when a change that --fail names is among them."""
    patterns = transitions.parse_patterns(options.fail) if options.fail is not None else ()
    if len(options.places) > 2:
        raise UserError(f"Two stores can be compared, not {len(options.places)}.")
    project = open_project(options.storage)
    tiers = project.tiers(options.tier)
    old, new = (side.of(tiers) for side in _sides(project, tiers, options.places))
    found = transitions.compare(old.verdicts, new.verdicts)
    drift, digests = comparison.compare_trials(old, new)
    for line in (
        f"old: {old.name}",
        f"new: {new.name}",
        f"verdicts: {transitions.counts(found)}",
        *(f"  {transitions.describe(one)}" for one in found if one.kind not in UNSAID),
        *comparison.version_changes(old, new),
        *_drift_lines(drift, digests, new),
        *_one_sided(old, new),
        *(trouble for side in (old, new) for trouble in side.troubles),
    ):
        print(line)
    matched = transitions.matched(found, patterns)
    for one in matched:
        print(f"FAIL {transitions.describe(one)}")
    return int(bool(matched))


def _sides(project: Project, tiers: Sequence[str], places: Sequence[str]) -> tuple[Side, Side]:
    """Return the old and the new side that the command line names."""
    reproduction = project.reproduction
    if places:
        return _stores(project, tiers, *[*map(_store, places), project.store][:2])
    accepted = comparison.committed(reproduction)
    if not accepted.verdicts:
        raise UserError("No verdict has been accepted yet: run `evoclaims accept` to accept the current ones.")
    now = comparison.store(reproduction, project.archive, project.judge(*tiers))
    name = f"judged from the store {project.store.root}, and from reference trials where it has no better ones"
    return accepted, replace(now, name=name)


def _store(name: str) -> Store:
    if not os.path.isdir(name):
        raise UserError(f"There is no trial store {name!r}: no folder has this name. Check it.")
    return open_store(name)


def _stores(project: Project, tiers: Sequence[str], old: Store, new: Store) -> tuple[Side, Side]:
    """Judge two stores, each from its own trials alone."""
    for store in (old, new):
        if not store.ids():
            raise UserError(f"The folder {store.root} holds no trials, so there is nothing to compare.")
    reproduction = project.reproduction
    rooted = [Store(store.root.absolute()) for store in (old, new)]  # found even if a claim test changes the folder
    sessions = [Session(reproduction, store, StoredOnly(Archive(store))) for store in rooted]
    found = project.judge_sessions([(session, tier) for tier in tiers for session in sessions])
    before, after = chain.from_iterable(found[::2]), chain.from_iterable(found[1::2])
    return comparison.store(reproduction, Archive(old), before), comparison.store(reproduction, Archive(new), after)


def _drift_lines(drift: DriftReport, digests: DigestCheck, new: Side) -> Iterator[str]:
    names = {trials[0].condition: name for name, trials in new.trials.items() if trials}
    yield f"trials: {drift.counts}"
    yield from (f"  {line}" for line in drift.lines)
    if drift.nearest is not None and not drift.drifted:
        yield f"  {drift.undecided}"
    yield f"to the bit: {digests.compared} trials compared, {len(digests.changed)} changed"
    seeds: dict[str, list[int]] = {}
    for change in digests.changed:
        seeds.setdefault(change.condition, []).append(change.seed)
    for condition, those in seeds.items():
        yield f"  CHANGED in {names.get(condition, condition)}: seeds {', '.join(map(str, sorted(set(those))))}"


def _one_sided(old: Side, new: Side) -> Iterator[str]:
    """Yield a line for the conditions that only one side has trials of."""
    for word, names in (("old", old.trials.keys() - new.trials.keys()), ("new", new.trials.keys() - old.trials.keys())):
        if names:
            yield f"trials of the {word} side alone: {listed(sorted(names))}"
