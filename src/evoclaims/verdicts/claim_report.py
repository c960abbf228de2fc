"""What became of one claim test, as plain data that crosses processes and goes into files."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from evoclaims.core.canonical import as_plain
from evoclaims.core.errors import UserError
from evoclaims.core.file_names import file_name
from evoclaims.core.files import write_atomically
from evoclaims.judging.verdict import Outcome
from evoclaims.verdicts.versions import of_sources


@dataclass(frozen=True)
class ClaimReport:
    """One claim, at one tier, with one set of parameters.

    Attributes:
        claim: id of the claim.
        case: the parameters, such as "n_parity"; empty without any.
        tier: "smoke" or "full".
        statement: what was judged: the paper's sentence, or its scaled-down version.
        where: place in the paper.
        outcome, reason: the verdict in short.
        expected, because: an accepted outcome, if there is one.
        verdict: the whole verdict as JSON; None when the test broke before judging.
        sources: for each condition: "method", "task", "condition" (id), "trials" (ids), "versions" (of the packages
            that it depends on: the different ones that the trials were made with) and "again" (seeds that this run has
            run again, since the store's trials were made with other versions).
        attainable: for each look: "n", "alpha", and the smallest p for ("supported") and against ("refuted").
        evidence: path of the file that holds all this.
        variant: name of the variant of the protocol; empty for the protocol itself.
        unsaved: why that file could not be written; empty when it was, or was not to be.
        before: "outcome", "fingerprint" and "versions" of the verdict that the store held before this run, if any.
    """

    claim: str
    case: str
    tier: str
    statement: str
    where: str
    outcome: str
    reason: str
    expected: str | None = None
    because: str = ""
    verdict: dict[str, Any] | None = None
    sources: tuple[dict[str, Any], ...] = ()
    attainable: tuple[dict[str, Any], ...] = ()
    evidence: str = ""
    variant: str = ""
    unsaved: str = ""
    before: dict[str, Any] | None = None

    @property
    def name(self) -> str:
        """Id and parameters, such as "G1[n_parity]"."""
        return named(self.claim, self.case)

    @property
    def as_expected(self) -> bool:
        """Whether the outcome has been accepted beforehand."""
        return self.expected == self.outcome

    @property
    def failed(self) -> bool:
        """Whether this ends the run with status 1: refuted or broken, and not accepted; of a variant, broken alone."""
        failures = (Outcome.ERROR,) if self.variant else (Outcome.REFUTED, Outcome.ERROR)
        return self.outcome in failures and not self.as_expected

    @property
    def n(self) -> int:
        """Trials a side that were looked at."""
        return int(self.verdict["n"]) if self.verdict else 0

    def to_json(self) -> dict[str, Any]:
        """Return the report as plain JSON, with no enumerations left in it: xdist passes on built-in types alone."""
        plain: dict[str, Any] = json.loads(json.dumps(as_plain(self)))
        return plain

    @staticmethod
    def from_json(plain: dict[str, Any]) -> ClaimReport:
        """Return the report that `to_json` gave."""
        return ClaimReport(**{**plain, "sources": tuple(plain["sources"]), "attainable": tuple(plain["attainable"])})


def named(claim_id: str, case: str) -> str:
    """Return what a claim with some parameters is called, such as "G1[n_parity]"; its id alone without any."""
    return f"{claim_id}[{case}]" if case else claim_id


def save(report: ClaimReport, root: Path) -> ClaimReport:
    """Write the report under `root`/verdicts and return it with the path filled in, or why it could not be written."""
    saved = replace(report, evidence=str(_path(report, root)))
    try:
        write_atomically(_path(report, root), (json.dumps(saved.to_json(), indent=1, sort_keys=True) + "\n").encode())
    except UserError as error:  # a full or read-only disk must not hide the verdict
        return replace(report, unsaved=str(error))
    return saved


def succeeding(report: ClaimReport, root: Path) -> ClaimReport:
    """Return the report with what the file of the claim's last verdict, which it takes the place of, says of that."""
    try:
        last = ClaimReport.from_json(json.loads(_path(report, root).read_bytes()))
        mark = (last.verdict or {}).get("fingerprint")
        before = {"outcome": last.outcome, "fingerprint": mark, "versions": of_sources(last.sources)}
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return report  # none, or one that another release has written: nothing is judged from it
    return replace(report, before=before)


def located(report: ClaimReport, root: Path) -> ClaimReport:
    """Return the report with the path of the file that an earlier run has written, if there is one."""
    path = _path(report, root)
    return replace(report, evidence=str(path)) if os.path.isfile(path) else report


def _path(report: ClaimReport, root: Path) -> Path:
    """Return where a report's file lies."""
    folder = root / "verdicts" / report.tier
    if report.variant:
        folder = folder / "variants" / file_name(report.variant)
    return folder / f"{file_name(report.claim, report.case)}.json"
