"""`evoclaims export`: trials as a table for other programs."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from evoclaims.cli.project import ALL_TIERS, Project, open_project
from evoclaims.cli.terminal import REPORT, write
from evoclaims.core.canonical import content_hash
from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.paper import references
from evoclaims.paper.archive import names_of
from evoclaims.trials.result import TrialResult
from evoclaims.trials.store import DamagedFileError
from evoclaims.verdicts import export


def main(options: argparse.Namespace) -> int:
    """Write the table; 1 when a damaged file was left out."""
    if options.form not in export.FORMS:
        raise UnknownNameError("form", options.form, export.FORMS)
    project = open_project(options.storage)
    tiers = project.tiers(options.tier)
    damaged: list[DamagedFileError] = []
    names = {
        condition: [name for name in known if name.tier in tiers]
        for condition, known in names_of(project.reproduction).items()
    }
    trials = _trials(project, damaged)
    rows = export.trial_rows((t for t in trials if options.tier == ALL_TIERS or names.get(t.condition)), names)
    if not rows:
        raise UserError(
            f"Neither {options.storage} nor the reference trials hold a trial of this tier; "
            f"`evoclaims run{project.store.option}` runs some."
        )
    out = Path(options.out or REPORT / f"trials.{options.form}")
    write(out, export.FORMS[options.form](rows), ours=options.out is None)
    print(f"wrote {out}: {len(rows)} trials")
    for error in damaged:
        print(f"left out: {error}", file=sys.stderr)
    return int(bool(damaged))


def _trials(project: Project, damaged: list[DamagedFileError]) -> list[TrialResult]:
    """Return all records of the store, one per trial and set of versions, then further reference trials."""
    found = {_key(trial): trial for trial in project.store.results(damaged)}
    for path in sorted(project.reproduction.references.rglob("*.jsonl")):
        for trial in references.load(path):
            found.setdefault(_key(trial), trial)
    return list(found.values())


def _key(trial: TrialResult) -> tuple[str, str, str]:
    """Return a record's key: its trial, its outcome, and the versions that it was made with."""
    return trial.id, trial.digest, content_hash(trial.provenance.get("versions"))
