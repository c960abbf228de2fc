"""The table of all verdicts: what the paper says, and below it what the benchmark checks of itself."""

from __future__ import annotations

from laboratory import Laboratory

from evoclaims.judging.verdict import Outcome
from evoclaims.report.trial_summary import Reader
from evoclaims.report.verdict_overview import overview
from evoclaims.verdicts.claim_report import CONTROL, ClaimReport


def _report(claim: str, where: str) -> ClaimReport:
    return ClaimReport(claim, "", "full", "", where, Outcome.NOT_RUN, "")


def test_controls_are_no_sentences_of_the_paper_and_have_a_table_of_their_own(lab: Laboratory) -> None:
    reports = [_report("C1", CONTROL), _report("G1", "§5.1")]
    text = overview({"full": reports}, {"C1": "Nothing learns", "G1": "It solves"}, Reader(lab.archive))
    papers, controls = text.split("\n\n")[:2]
    assert papers.splitlines()[::2] == ["| claim | the paper says | full |", "| G1 | It solves | not run |"]
    assert controls.splitlines()[::2] == [
        "| control | what the benchmark checks | full |",
        "| C1 | Nothing learns | not run |",
    ]


def test_a_paper_without_controls_has_one_table(lab: Laboratory) -> None:
    text = overview({"full": [_report("G1", "§5.1")]}, {"G1": "It solves"}, Reader(lab.archive))
    assert "control" not in text
