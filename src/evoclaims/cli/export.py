"""`evoclaims export`: trials or verdicts as a table for other programs."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from evoclaims.claims.fetching import StoredOnly
from evoclaims.cli.project import judge_stored, open_archive, open_project
from evoclaims.cli.stored import write
from evoclaims.cli.tiers import ALL, tiers_of
from evoclaims.core.canonical import content_hash
from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.paper import references
from evoclaims.paper.condition_names import names_of
from evoclaims.paper.reproduction import Reproduction
from evoclaims.trials.result import TrialResult
from evoclaims.trials.store import DamagedFileError
from evoclaims.verdicts import export


def main(options: argparse.Namespace) -> int:
    """Write the table; 1 when a damaged file was left out."""
    if options.form not in export.FORMS:
        raise UnknownNameError("form", options.form, export.FORMS)
    config, reproduction = open_project()
    tiers = tiers_of(reproduction, options.tier)
    damaged: list[DamagedFileError] = []
    if options.verdicts:
        what = "verdicts"
        rows = export.verdict_rows(r for tier in tiers for r in judge_stored(config, options.storage, tier))
    else:
        what = "trials"
        names = {
            condition: [name for name in known if name.tier in tiers]
            for condition, known in names_of(reproduction).items()
        }
        trials = _trials(reproduction, options.storage, damaged)
        rows = export.trial_rows((t for t in trials if options.tier == ALL or names.get(t.condition)), names)
        if not rows:
            raise UserError(
                f"Neither {options.storage} nor the reference trials hold a trial of this tier; "
                "`evoclaims run` runs some."
            )
    out = Path(options.out or f"{what}.{options.form}")
    write(out, export.FORMS[options.form](rows))
    print(f"wrote {out}: {len(rows)} {what}")
    for error in damaged:
        print(f"left out: {error}", file=sys.stderr)
    return int(bool(damaged))


def _trials(reproduction: Reproduction, storage: str, damaged: list[DamagedFileError]) -> list[TrialResult]:
    """Return all records of the store, several of a trial that several versions have run, then further references."""
    archive = open_archive(storage, reproduction)
    StoredOnly(archive).check()
    found = {_key(trial): trial for trial in archive.store.results(damaged)}
    for path in sorted(reproduction.references.rglob("*.jsonl")):
        for trial in references.load(path):
            found.setdefault(_key(trial), trial)
    return list(found.values())


def _key(trial: TrialResult) -> tuple[str, str, str]:
    """Return what tells a record from others: its trial, its outcome, and the versions that it was made with."""
    return trial.id, trial.digest, content_hash(trial.provenance.get("versions"))
