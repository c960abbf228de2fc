"""The files of evidence of one store copied into another."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from evoclaims.core.errors import UserError
from evoclaims.core.files import read_json
from evoclaims.trials.merging import Merged
from evoclaims.trials.store import Store
from evoclaims.verdicts.claim_report import ClaimReport, evidence_path, save


def merge_evidence(source: Store, into: Store, dry_run: bool = False) -> Iterator[Merged]:
    """Copy the last verdict of each claim, where the other store has none.

    Nothing is judged from these files: the next run with all trials writes them anew.

    Raises:
        UserError: when the disk is full or read-only.
    """
    for path in sorted((source.root / "verdicts").rglob("*.json")):
        if path.name.startswith("."):
            continue
        report = _read(path, source.root)
        if report is None:
            yield Merged(path, "damaged", "it is left out: it holds no verdict of the claim that it is named after")
            continue
        target = evidence_path(report, into.root)
        if target.exists():
            there = _read(target, into.root)
            if there is None or replace(there, evidence="") == replace(report, evidence=""):
                yield Merged(path, "there")
            else:
                note = f"{report.outcome}, and {there.outcome} in {target}, which stays until claims are judged again"
                yield Merged(path, "differs", note)
            continue
        if not dry_run:
            saved = save(report, into.root)
            if saved.unsaved:
                raise UserError(saved.unsaved)
        yield Merged(path, "copied")


def _read(path: Path, root: Path) -> ClaimReport | None:
    """Read a file of evidence; None where it is damaged, or in a place that is not its claim's."""
    try:
        report = ClaimReport.from_json(read_json(path))
    except (OSError, ValueError):
        return None
    return report if evidence_path(report, root) == path else None
