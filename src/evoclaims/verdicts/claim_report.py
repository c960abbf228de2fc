"""The report of one claim test, and the only place that converts it to JSON and back."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from typing import Any, Final

from msgspec import convert

from evoclaims.core.canonical import as_plain
from evoclaims.core.errors import UserError
from evoclaims.core.files import file_name, write_atomically
from evoclaims.judging.verdict import OUT_OF_TIME, Outcome, Verdict
from evoclaims.verdicts.readings import ReadAs, depends
from evoclaims.verdicts.source_trials import SourceTrials

CONTROL: Final = "control"
"""What a claim says in `where` that is not the paper's, but a check of the benchmark itself."""
MECHANISM: Final = "mechanism"
"""What a claim says in `where` that is not the paper's, but about a part of a method or a task."""


@dataclass(frozen=True)
class Attainable:
    """One look at the data, and the smallest p that it can give for the claim, against it, and against its size."""

    n: int
    alpha: float
    supported: float
    refuted: float
    smaller: float | None = None


@dataclass(frozen=True)
class EarlierRun:
    """How a claim's test ended before it ran again in the same run of pytest: it no longer counts.

    Attributes:
        outcome, reason: the verdict in short.
        p: of the whole assertion; None if nothing was tested.
    """

    outcome: Outcome
    reason: str
    p: float | None


class Tried(StrEnum):
    """The result of trying planted faults on a claim."""

    SENSITIVE = "sensitive"
    INSENSITIVE = "insensitive"
    NOT_TRIED = "not tried"


class Tally(StrEnum):
    """What a claim counts as: its outcome, unless no planted fault changes its support, or a null agent has it, too."""

    SUPPORTED = "supported"
    INSENSITIVE = "supported but insensitive"
    VACUOUS = "supported but vacuous"
    REFUTED = "refuted"
    SMALLER = "smaller than claimed"
    INCONCLUSIVE = "inconclusive"
    ERROR = "error"
    NOT_RUN = "not run"

    @property
    def symbol(self) -> str:
        """One character for tables: the outcome's."""
        return (Outcome.SUPPORTED if self in APART else Outcome(self.value)).symbol


APART: Final = (Tally.INSENSITIVE, Tally.VACUOUS)
"""Support that is counted apart; tables leave it out where it is 0."""


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
        verdict: the whole verdict; None when the test broke before judging.
        sources: the trials behind it, by condition.
        attainable: one entry per look.
        evidence: path of the file that holds this report.
        variant: name of the variant of the protocol; empty for the protocol itself.
        unsaved: why that file could not be written; empty if it was, or need not be.
        tried: whether planted faults change the verdict, according to the committed matrix of mutants.
        has_test: whether the claim has a test at this tier.
        line: of the paper's source in which the sentence stands; None where the claim does not say.
        asserts: hash of the assertion alone, which two claims with one assertion share; empty where none was judged.
        readings: of the sentence, the judged one first; empty where only that one was judged.
        satisfied_by: names of the null agents that satisfy the assertion. Under a variant only a supported one is put
            to them.
        unasked: null agents that could not be put to the assertion, each with the reason; no file has them.
        earlier: how its test ended before a plugin ran it again, oldest first; the last run counts.
        chance: of a claim that is inconclusive and was accepted as supported, how often draws from its pilots end so;
            None where that is not known.
    """

    claim: str
    case: str
    tier: str
    statement: str
    where: str
    outcome: Outcome
    reason: str
    expected: Outcome | None = None
    because: str = ""
    verdict: Verdict | None = None
    sources: tuple[SourceTrials, ...] = ()
    attainable: tuple[Attainable, ...] = ()
    evidence: str = ""
    variant: str = ""
    unsaved: str = ""
    tried: Tried = Tried.NOT_TRIED
    has_test: bool = True
    line: int | None = None
    asserts: str = ""
    readings: tuple[ReadAs, ...] = ()
    satisfied_by: tuple[str, ...] = ()
    earlier: tuple[EarlierRun, ...] = ()
    chance: float | None = None
    unasked: tuple[tuple[str, str], ...] = field(default=(), metadata={"canonical": False})

    @property
    def name(self) -> str:
        """Id and parameters, such as "G1[n_parity]"."""
        return named(self.claim, self.case)

    @property
    def is_control(self) -> bool:
        """Whether it is no sentence of the paper: a control of the benchmark, or about a mechanism."""
        return self.where in (CONTROL, MECHANISM)

    @property
    def counted_as(self) -> Tally:
        """What the claim counts as, wherever claims are counted."""
        if self.is_vacuous:
            return Tally.VACUOUS
        insensitive = (self.outcome, self.tried) == (Outcome.SUPPORTED, Tried.INSENSITIVE)
        return Tally.INSENSITIVE if insensitive else Tally(self.outcome.value)

    @property
    def wants_time(self) -> bool:
        """Whether it is undecided and some of its trials ran out of time: with more time it may be decided."""
        ended = self.verdict.without_result if self.verdict else ""
        return self.outcome is Outcome.INCONCLUSIVE and OUT_OF_TIME in ended

    @property
    def is_vacuous(self) -> bool:
        """Whether it is supported, a null agent would be, too, and no planted fault has shown that it can fail."""
        return self.outcome is Outcome.SUPPORTED and bool(self.satisfied_by) and self.tried is not Tried.SENSITIVE

    @property
    def depends_on_the_reading(self) -> bool:
        """Whether another reading of the sentence ends otherwise."""
        return depends(self.readings)

    @property
    def as_expected(self) -> bool:
        """Whether the outcome has been accepted beforehand."""
        return self.expected == self.outcome

    @property
    def failed(self) -> bool:
        """Whether this ends the run with status 1, if it is not accepted: something against it is shown, or it broke.

        For a variant only if it broke.
        """
        failed = self.outcome is Outcome.ERROR or (self.outcome.is_against and not self.variant)
        return failed and not self.as_expected

    @property
    def n(self) -> int:
        """Number of judged trials per side."""
        return self.verdict.n if self.verdict else 0

    @property
    def p(self) -> float | None:
        """The p value for the claim; None if nothing was tested."""
        return self.verdict.p if self.verdict else None

    @property
    def fingerprint(self) -> str:
        """Hash of what was fixed beforehand; empty where the test broke before judging."""
        return self.verdict.fingerprint if self.verdict else ""

    def to_json(self) -> dict[str, Any]:
        """Return the report as strict JSON, infinities as "inf" or "-inf": xdist transfers only built-in types."""
        plain: dict[str, Any] = json.loads(json.dumps(as_plain(self)))
        return plain

    @staticmethod
    def from_json(plain: dict[str, Any]) -> ClaimReport:
        """Return a report from the output of `to_json`.

        Raises:
            ValueError: for anything else.
        """
        return convert(plain, ClaimReport, strict=False)  # not strictly, since infinities are texts


def named(claim_id: str, case: str) -> str:
    """Return the name of a claim with its parameters, such as "G1[n_parity]"; just its id without any."""
    return f"{claim_id}[{case}]" if case else claim_id


def save(report: ClaimReport, root: Path) -> ClaimReport:
    """Write the report under `root`/verdicts and return it with the path filled in, or why it could not be written."""
    saved = replace(report, evidence=str(evidence_path(report, root)))
    try:
        text = json.dumps(saved.to_json(), indent=1, sort_keys=True) + "\n"
        write_atomically(evidence_path(report, root), text.encode())
    except UserError as error:  # a full or read-only disk must not hide the verdict
        return replace(report, unsaved=str(error))
    return saved


def located(report: ClaimReport, root: Path) -> ClaimReport:
    """Return the report with the path of the file that an earlier run wrote, if any."""
    path = evidence_path(report, root)
    return replace(report, evidence=str(path)) if os.path.isfile(path) else report


def evidence_path(report: ClaimReport, root: Path) -> Path:
    """Return the path of a report's file."""
    folder = root / "verdicts" / report.tier
    if report.variant:
        folder = folder / "variants" / file_name(report.variant)
    return folder / f"{file_name(report.claim, report.case)}.json"
