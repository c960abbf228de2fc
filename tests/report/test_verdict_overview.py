"""The table of all verdicts: what the paper says, and below it what the benchmark checks of itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

from laboratory import Laboratory

from evoclaims.judging.verdict import Outcome
from evoclaims.report.trial_summary import Reader
from evoclaims.report.verdict_overview import Environments, overview
from evoclaims.verdicts.claim_report import CONTROL, MECHANISM, ClaimReport
from evoclaims.verdicts.source_trials import SourceTrials


def _report(claim: str, where: str) -> ClaimReport:
    return ClaimReport(claim, "", "full", "", where, Outcome.NOT_RUN, "")


def test_controls_are_no_sentences_of_the_paper_and_have_a_table_of_their_own(lab: Laboratory) -> None:
    reports = [_report("K1", MECHANISM), _report("C1", CONTROL), _report("G1", "§5.1")]
    says = {"K1": "It selects", "C1": "Nothing learns", "G1": "It solves"}
    text = overview({"full": reports}, says, Reader(lab.archive))
    papers, controls, mechanisms = text.split("\n\n")[:3]
    assert mechanisms.splitlines()[::2] == [
        "| mechanism | what a part of a method or a task does | full |",
        "| K1 | It selects | not run |",
    ]
    assert papers.splitlines()[::2] == ["| claim | the paper says | full |", "| G1 | It solves | not run |"]
    assert controls.splitlines()[::2] == [
        "| control | what the benchmark checks | full |",
        "| C1 | Nothing learns | not run |",
    ]


class _OnMachines:
    """Reads trials whose ids are the devices that they were made on."""

    def read(self, trials: Sequence[str], versions: object) -> list[Any]:
        return [SimpleNamespace(origin=SimpleNamespace(device=trial, versions=())) for trial in trials]


def test_letters_go_on_after_z_and_are_the_legends() -> None:
    made = Environments(_OnMachines())  # type: ignore[arg-type]
    machines = [f"machine {number}" for number in range(53)]

    def letters(*on: str) -> str:
        return made.letters(replace(_report("G1", "§5.1"), sources=(SourceTrials("", "", "", on, {}, ()),)))

    given = [letters(machine) for machine in machines]
    assert (given[:2], given[25:28], given[51:]) == (["A", "B"], ["Z", "A1", "B1"], ["Z1", "A2"])
    assert [line.partition("; ")[0] for line in made.legend().splitlines()] == [
        f"* {letter}: {machine}" for letter, machine in zip(given, machines, strict=True)
    ]
    assert letters(machines[26], machines[25], machines[0]) == "A, Z, A1"
