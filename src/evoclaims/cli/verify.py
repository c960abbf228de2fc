"""`evoclaims verify`: every trial, champion and checkpoint of the store read back.

Files of verdicts are not read: nothing is judged from them, and each run with the same claims rewrites them.
"""

from __future__ import annotations

import argparse

from evoclaims.cli.store_folder import open_store
from evoclaims.trials.integrity import verify


def main(options: argparse.Namespace) -> int:
    """List problems and move bad files aside; 1 when there were any."""
    store = open_store(options.storage)
    problems = verify(store, repair=not options.dry_run)
    for problem in problems:
        print(problem)
    print(f"{len(store.ids())} trials in {store.root}, {len(problems)} problems")
    return int(bool(problems))
