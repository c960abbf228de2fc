"""`evoclaims reference`: stored trials become the committed reference trials."""

from __future__ import annotations

import argparse
from itertools import takewhile

from evoclaims.cli.project import judge_stored, open_project, open_store
from evoclaims.core.errors import UserError
from evoclaims.judging.baseline import MIN_REFERENCES
from evoclaims.suite import references
from evoclaims.trials.spec import TrialSpec
from evoclaims.trials.time_limit import is_final


def main(options: argparse.Namespace) -> int:
    """Write one file per condition that the tier's claims use and the store holds enough trials of."""
    config, reproduction = open_project()
    tier, store = reproduction.tier(options.tier, options.variant), open_store(options.storage)
    reports = judge_stored(config, options.storage, options.tier, options.variant)
    used = sorted({(source["method"], source["task"]) for report in reports for source in report.sources})
    if options.variant:
        changes = reproduction.variants[options.variant].conditions.get(options.tier, {})
        used = [names for names in used if names in changes]
    # A claim is judged after each look; the drift check wants as many as MIN_REFERENCES.
    looks = [look.n for look in tier.protocol.looks[:-1]]
    sizes = [*looks, max(tier.protocol.last.n, MIN_REFERENCES)]
    written = 0
    for method, task in used:
        condition = tier.condition(method, task)
        seeds = range(tier.protocol.first_seed, tier.protocol.first_seed + sizes[-1])
        found = [store.get(TrialSpec(condition, seed).id) for seed in seeds]
        results = list(takewhile(is_final, found))
        size = max((size for size in sizes if size <= len(results)), default=0)
        path = references.path_of(reproduction.references_of(options.variant), options.tier, method, task)
        committed = sum(trial.condition == condition.id for trial in references.load(path))
        needed = max(committed, sizes[0])
        if size < needed:
            stored = sum(map(is_final, found))
            print(f"left alone: {method} on {task}: {stored} of {needed} trials are stored")
            continue
        references.write(path, (result for result in results[:size] if result is not None))
        written += 1
        print(f"wrote {path}: {size} trials")
    if not written:
        raise UserError(
            f"No condition of the {options.tier} tier has {sizes[0]} stored trials; run them first with "
            f"`evoclaims run --tier {options.tier}`."
        )
    return 0
