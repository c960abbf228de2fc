"""`evoclaims reference`: stored trials become the committed reference trials."""

from __future__ import annotations

import argparse

from evoclaims.cli.project import judge_stored, open_project, open_store
from evoclaims.core.errors import UserError
from evoclaims.judging.baseline import MIN_REFERENCES
from evoclaims.suite import references
from evoclaims.trials.spec import TrialSpec


def main(options: argparse.Namespace) -> int:
    """Write one file per condition that the tier's claims use and the store holds enough trials of."""
    config, reproduction = open_project()
    tier, store = reproduction.tier(options.tier, options.variant), open_store(options.storage)
    reports = judge_stored(config, options.storage, options.tier, options.variant)
    used = sorted({(source["method"], source["task"]) for report in reports for source in report.sources})
    if options.variant:
        changes = reproduction.variants[options.variant].conditions.get(options.tier, {})
        used = [names for names in used if names in changes]
    written = 0
    for method, task in used:
        condition = tier.condition(method, task)
        seeds = range(tier.protocol.first_seed, tier.protocol.first_seed + max(tier.protocol.last.n, MIN_REFERENCES))
        found = [store.get(TrialSpec(condition, seed).id) for seed in seeds]
        results = [result for result in found if result is not None]
        path = references.path_of(reproduction.references_of(options.variant), options.tier, method, task)
        if len(results) < len(seeds):
            print(f"left alone: {method} on {task}: {len(results)} of {len(seeds)} trials are stored")
            continue
        references.write(path, results)
        written += 1
        print(f"wrote {path}: {len(results)} trials")
    if not written:
        raise UserError(
            f"No condition of the {options.tier} tier has {MIN_REFERENCES} stored trials; run them first with "
            f"`evoclaims run --tier {options.tier}`."
        )
    return 0
