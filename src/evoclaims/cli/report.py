"""`evoclaims report`: a web page and a Markdown file about all claims."""

from __future__ import annotations

import argparse
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path

from evoclaims.cli.project import judge_stored, open_archive, open_project
from evoclaims.cli.stored import write
from evoclaims.core.errors import UnknownNameError
from evoclaims.report.gather import gather
from evoclaims.report.markdown import markdown
from evoclaims.report.page import html
from evoclaims.report.plates import plates
from evoclaims.suite import history, table
from evoclaims.trials.records import printable

ALL = "all"


def main(options: argparse.Namespace) -> int:
    """Judge from the trials at hand, write both files, and print where they are."""
    config, reproduction = open_project()
    tiers = list(reproduction.tiers)[::-1]  # the paper's own sentences come first
    if options.tier not in (*tiers, ALL):
        raise UnknownNameError("tier", options.tier, (*tiers, ALL))
    # Every tier is judged, since the paper's sentence is the statement of the largest.
    verdicts = {tier: judge_stored(config, options.storage, tier) for tier in tiers}
    archive = open_archive(options.storage, reproduction)
    shown = {tier: reports for tier, reports in verdicts.items() if options.tier in (tier, ALL)}
    drawn, missing = plates(reproduction, archive, next(iter(shown)))
    page = gather(
        reproduction,
        shown,
        archive,
        history.load(reproduction.folder / history.FILE),
        sentences={report.name: report.statement for report in verdicts[tiers[0]]},
        plates=drawn,
        missing=missing,
        generated=f"Written on {datetime.now(UTC):%Y-%m-%d %H:%M} UTC by evoclaims {metadata.version('evoclaims')}.",
    )
    folder = Path(options.out)
    for name, text in (("index.html", html(page)), ("report.md", markdown(page))):
        write(folder / name, text.encode())
        print(f"wrote {printable(folder / name)}")
    for board in page.boards:
        print(f"claims ({board.tier}): {table.totals(verdicts[board.tier])}")
    return 0
