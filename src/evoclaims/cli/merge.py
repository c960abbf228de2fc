"""`evoclaims merge`: trials, champions and files of evidence of other stores, copied into one."""

from __future__ import annotations

import argparse
import os
from collections import Counter
from collections.abc import Iterator

from evoclaims.cli.store_folder import open_store
from evoclaims.core.errors import UserError
from evoclaims.trials.merging import Merged, merge_trials
from evoclaims.trials.store import Store
from evoclaims.verdicts.merging import merge_evidence


def main(options: argparse.Namespace) -> int:
    """Copy what is whole and new, and name what differs or is damaged; 1 when trials differ or files are damaged."""
    into = open_store(options.storage)
    sources = [_source(name, into) for name in options.stores]
    if not options.dry_run:
        into.check_writable()
    wrong = False
    for source in sources:
        trials, trials_wrong = _counted(merge_trials(source, into, options.dry_run))
        verdicts, _ = _counted(merge_evidence(source, into, options.dry_run))
        damaged = trials["damaged"] + verdicts["damaged"]
        wrong = wrong or trials_wrong or bool(damaged)
        copied = "to copy" if options.dry_run else "copied"
        print(
            f"{source.root}: trials: {trials['copied']} {copied} into {into.root}, {trials['there']} there already, "
            f"{trials['differs']} different; verdicts: {verdicts['copied']} {copied}; damaged files left out: {damaged}"
        )
    return int(wrong)


def _source(name: str, into: Store) -> Store:
    """Return a store to copy from.

    Raises:
        UserError: when it does not exist, or is the one to copy into.
    """
    if not name or not os.path.lexists(name):
        raise UserError(f"There is no trial store {name!r}: the folder does not exist. Check its name.")
    source = open_store(name)
    if source.root.resolve() == into.root.resolve():
        raise UserError(
            f"{name} is the store to copy into. Name other stores, or name the store to copy into with --storage."
        )
    return source


def _counted(files: Iterator[Merged]) -> tuple[Counter[str], bool]:
    """Print what differs or is damaged; return how many files have which fate, and whether any was printed."""
    counts: Counter[str] = Counter()
    for one in files:
        counts[one.fate] += 1
        if one.reason:
            print(one)
    return counts, bool(counts["differs"] or counts["damaged"])
