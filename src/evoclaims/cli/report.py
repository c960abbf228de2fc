"""`evoclaims report`: a web page and a Markdown file about all claims."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

from evoclaims.cli.episodes import run_again
from evoclaims.cli.project import judge_stored, open_archive, open_project
from evoclaims.cli.stored import Stored, write
from evoclaims.core.errors import UnknownNameError
from evoclaims.envs.ecorobot.robot_task import RobotTask
from evoclaims.envs.ecorobot.views import pictures
from evoclaims.paper.archive import Archive
from evoclaims.paper.config import SuiteConfig
from evoclaims.paper.reproduction import Reproduction
from evoclaims.report import table_cells
from evoclaims.report.build import gather
from evoclaims.report.champion import network
from evoclaims.report.html import html
from evoclaims.report.markdown import markdown
from evoclaims.report.paper_figures import paper_figures
from evoclaims.trials import devices
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Condition
from evoclaims.verdicts import history
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.robustness import Robustness, matrix

ALL = "all"


def main(options: argparse.Namespace) -> int:
    """Judge from the trials at hand, write both files, and print where they are."""
    config, reproduction = open_project()
    tiers = list(reproduction.tiers)[::-1]  # the paper's own sentences come first
    if options.tier not in (*tiers, ALL):
        raise UnknownNameError("tier", options.tier, (*tiers, ALL))
    shown = tiers if options.tier == ALL else [options.tier]
    # The paper's sentence is the statement of the largest tier, so that is judged in any case.
    verdicts = {tier: judge_stored(config, options.storage, tier) for tier in tiers if tier in (tiers[0], *shown)}
    archive = open_archive(options.storage, reproduction)
    robustness = [
        row
        for tier in shown
        for row in _robustness(config, reproduction, options.storage, tier, verdicts[tier], archive)
    ]
    drawn, missing = paper_figures(reproduction, archive, shown[0])
    page = gather(
        reproduction,
        {tier: verdicts[tier] for tier in shown},
        archive,
        history.load(reproduction.folder / history.FILE),
        sentences={report.name: report.statement for report in verdicts[tiers[0]]},
        draws=(trajectory, network) if options.trajectories else (network,),
        figures=drawn,
        missing=missing,
        robustness=robustness,
        generated=f"Written on {datetime.now(UTC):%Y-%m-%d %H:%M} UTC by evoclaims {metadata.version('evoclaims')}.",
    )
    folder = Path(options.out)
    for name, text in (("index.html", html(page)), ("report.md", markdown(page))):
        write(folder / name, text.encode())
        print(f"wrote {folder / name}")
    for board in page.boards:
        print(f"claims ({board.tier}): {table_cells.totals(verdicts[board.tier])}")
    return 0


def _robustness(
    config: SuiteConfig,
    reproduction: Reproduction,
    storage: str,
    tier: str,
    plain: Sequence[ClaimReport],
    archive: Archive,
) -> tuple[Robustness, ...]:
    """Judge a tier's claims under each variant that has run."""
    seeds = reproduction.tier(tier).protocol.seeds(1)
    tried = [
        name
        for name, variant in reproduction.variants.items()
        if any(archive.trials(condition, seeds)[0] for condition in variant.conditions.get(tier, {}).values())
    ]
    return matrix(plain, {name: judge_stored(config, storage, tier, name) for name in tried})


def trajectory(condition: Condition, result: TrialResult, parameters: Any, title: str) -> bytes | None:
    """Draw the ways that a champion on a robot's task takes in its evaluation, run again; None for other tasks."""
    if not isinstance(condition.task, RobotTask):
        return None
    trial = Stored(title, condition, result, parameters, Path())
    (device, *_) = devices.choose("auto")
    return pictures.draw(condition.task, run_again(trial, condition.task, device).torsos, title, "svg")
