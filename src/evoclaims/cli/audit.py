"""`evoclaims audit`: what verdicts rest on, from the trials at hand."""

from __future__ import annotations

import argparse

from evoclaims.cli.project import open_project
from evoclaims.paper.reported import uncovered
from evoclaims.report import audit


def main(options: argparse.Namespace) -> int:
    """Print the audit of a tier; 1 when a supported verdict is vacuous, or a claim lacks its line or date."""
    project = open_project(options.storage)
    tier = options.tier
    project.reproduction.tier(tier)
    reports, papers = project.judge_sessions([(project.session(), tier), (project.as_published(tier), tier)])
    rest = uncovered(project.reproduction.folder)
    for line in audit.lines(reports, papers, rest, len(project.reproduction.null_agents)):
        print(line)
    return int(audit.fails(reports))
