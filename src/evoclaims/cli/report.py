"""`evoclaims report`: a web page about all claims."""

from __future__ import annotations

import argparse
from dataclasses import replace
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path

from evoclaims.cli.project import ALL_TIERS, Project, open_project
from evoclaims.cli.store_folder import APART
from evoclaims.cli.terminal import REPORT, write
from evoclaims.core.errors import UserError
from evoclaims.figures import figure
from evoclaims.figures.replication import replications
from evoclaims.figures.sheet import svg
from evoclaims.paper.archive import Archive
from evoclaims.paper.reproduction import Reproduction
from evoclaims.report import across, table_cells, training_curves
from evoclaims.report.build import gather
from evoclaims.report.formatting import listed
from evoclaims.report.html import html
from evoclaims.report.model import PaperFigure
from evoclaims.verdicts import history, mutation_matrix, watch_file
from evoclaims.verdicts.transitions import matrix


def paper_figures(
    reproduction: Reproduction, archive: Archive, tier: str
) -> tuple[tuple[PaperFigure, ...], tuple[str, ...]]:
    """Return the figures with something to draw at a tier, and sentences about the others."""
    drawn: list[PaperFigure] = []
    empty: list[str] = []
    broken: dict[str, list[str]] = {}
    for name in figure.names(reproduction):
        try:
            drawing = figure.load(reproduction, name).draw(archive, reproduction, tier)
            if drawing.shown:
                says = " ".join((*drawing.caption, *drawing.missing))
                drawn.append(PaperFigure(drawing.title, says, svg(drawing).encode()))
            else:
                empty.append(name)
        except UserError as error:
            broken.setdefault(str(error), []).append(name)
    sentences = [f"Not drawn ({listed(names)}): {reason}" for reason, names in broken.items()]
    if empty:
        sentences.append(f"Not drawn, for want of trials at the {tier} tier: {listed(empty)}.")
    return tuple(drawn), tuple(sentences)


def main(options: argparse.Namespace) -> int:
    """Judge from the trials at hand, write the page, and print where it is."""
    project = open_project(options.storage)
    reproduction, archive = project.reproduction, project.archive
    tiers = list(reproduction.tiers)[::-1]  # the paper's own sentences come first
    shown = tiers if options.tier == ALL_TIERS else project.tiers(options.tier)
    # The paper's sentence is the statement of the largest tier, so that is judged in any case.
    asked = [(tier, "") for tier in tiers if tier in (tiers[0], *shown)]
    asked += [(tier, variant) for tier in shown for variant in _tried(project, tier)]
    of_variant = {variant: project.session(variant) for _, variant in asked}
    sessions = [(of_variant[variant], tier) for tier, variant in asked]
    *found, by_the_paper = project.judge_sessions([*sessions, (project.as_published(tiers[0]), tiers[0])])
    judged = dict(zip(asked, found, strict=True))
    verdicts = {tier: reports for (tier, variant), reports in judged.items() if not variant}
    robustness = [
        row
        for tier in shown
        for row in matrix(verdicts[tier], {name: judged[on, name] for on, name in asked if name and on == tier})
    ]
    drawn, missing = paper_figures(reproduction, archive, shown[0])
    gathered = gather(
        reproduction,
        {tier: verdicts[tier] for tier in shown},
        archive,
        history.load(reproduction.folder / history.FILE),
        sentences={report.name: report.statement for report in verdicts[tiers[0]]},
        put_to_the_paper=by_the_paper,
        mutants=mutation_matrix.load(reproduction.folder / mutation_matrix.FILE),
    )
    page = replace(
        gathered,
        figures=drawn,
        missing=missing,
        robustness=tuple(robustness),
        numbers=replications(archive, reproduction, tiers[0], ("", *reproduction.variants)),
        across=across.last({project.store.root.absolute(), project.config.root / APART["across"]}),
        watch=training_curves.by_night(watch_file.load(reproduction.folder / watch_file.FILE)[1]),
        generated=f"Written on {datetime.now(UTC):%Y-%m-%d %H:%M} UTC by evoclaims {metadata.version('evoclaims')}.",
    )
    out = Path(options.out or REPORT) / "index.html"
    write(out, html(page).encode(), "folder", ours=options.out is None)
    print(f"wrote {out}")
    for board in page.boards:
        print(f"claims ({board.tier}): {table_cells.totals(verdicts[board.tier])}")
    return 0


def _tried(project: Project, tier: str) -> list[str]:
    reproduction = project.reproduction
    design = reproduction.tier(tier).design
    return [
        name
        for name in reproduction.variants
        if any(
            project.archive.trials(condition, design.seeds(1, bool(condition.existing)))[0]
            for condition in reproduction.changed_by(name, tier).values()
        )
    ]
