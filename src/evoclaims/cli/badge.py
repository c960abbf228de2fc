"""`evoclaims badge`: how the claims of a tier stand, as a small picture."""

from __future__ import annotations

import argparse
from pathlib import Path

from evoclaims.cli.project import open_project
from evoclaims.cli.terminal import REPORT, write
from evoclaims.report.badge import colour_of, message_of, svg


def main(options: argparse.Namespace) -> int:
    """Judge from the trials at hand and write the picture."""
    project = open_project(options.storage)
    project.reproduction.tier(options.tier)
    reports = project.judge(options.tier)
    out = Path(options.out or REPORT / f"claims-{options.tier}.svg")
    message = message_of(reports)
    write(out, svg(f"claims ({options.tier})", message, colour_of(reports)).encode(), ours=options.out is None)
    print(f"wrote {out}: {message}")
    return 0
