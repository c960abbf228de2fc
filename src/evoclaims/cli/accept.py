"""`evoclaims accept`: the verdicts from the trials at hand become the accepted ones."""

from __future__ import annotations

import argparse
from datetime import UTC, datetime

from evoclaims.cli.project import open_project
from evoclaims.core.files import write_atomically
from evoclaims.verdicts import history
from evoclaims.verdicts.acceptance import accept
from evoclaims.verdicts.other_code import edits


def main(options: argparse.Namespace) -> int:
    """Write verdicts.toml and print what is new in it; 1 when anything is, so that no automation accepts it unseen."""
    project = open_project(options.storage)
    tiers = project.tiers(options.tier)
    path = project.reproduction.folder / history.FILE
    before = history.load(path)
    reports = project.judge(*tiers)
    made = accept(before, reports, project.archive, f"{datetime.now(UTC):%Y-%m-%d}")
    for line in made.left:
        print(f"left alone: {line}")
    now = {history.key_of(report) for report in reports}
    for tier, claim in sorted(before.keys() - now):
        if tier in tiers:
            print(f"kept: {claim} ({tier}), which is no longer among the claims")
    for line in edits(reports):
        print(line)
    if not (made.accepted or made.retired):
        print(f"{path} stays as it is: no verdict differs from the accepted one.")
        return 0
    write_atomically(path, history.dump(made.history).encode())
    for line in made.accepted:
        print(f"accepted: {line}")
    for line in made.retired:
        print(f"retired: {line}")
    print(f"wrote {path}: look at the changes and commit them")
    return 1
