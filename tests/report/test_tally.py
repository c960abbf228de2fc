"""The sentence that counts verdicts: every outcome once, controls apart."""

from __future__ import annotations

from dataclasses import replace

import pytest

from evoclaims.judging.verdict import Outcome
from evoclaims.report.table_cells import totals
from evoclaims.report.verdict_overview import tally
from evoclaims.verdicts.claim_report import CONTROL, MECHANISM, ClaimReport, Tried


def _reports(where: str, *outcomes: Outcome) -> list[ClaimReport]:
    return [ClaimReport("G1", str(case), "full", "", where, outcome, "") for case, outcome in enumerate(outcomes)]


@pytest.mark.parametrize(
    ("papers", "controls", "said"),
    [
        (
            (Outcome.REFUTED,),
            (),
            "Of 1 sentence of the paper, 1 **refuted in some case**. By case, of 1: 1 **refuted**.",
        ),
        (
            (Outcome.NOT_RUN, Outcome.REFUTED, Outcome.SUPPORTED, Outcome.SUPPORTED),
            (Outcome.SUPPORTED, Outcome.ERROR),
            "Of 1 sentence of the paper, 1 **refuted in some case**. By case, of 4: 2 **supported**, 1 **refuted** and "
            "1 **not run**. Of 2 cases of controls, which test the benchmark itself, 1 **supported** and 1 **error**.",
        ),
        ((), (), "Of 0 sentences of the paper, none. By case, of 0: none."),
        ((), (Outcome.SUPPORTED,), "Of 1 case of controls, which test the benchmark itself, 1 **supported**."),
    ],
)
def test_every_outcome_is_counted_once_and_controls_apart(
    papers: tuple[Outcome, ...], controls: tuple[Outcome, ...], said: str
) -> None:
    assert tally([*_reports("§5", *papers), *_reports(CONTROL, *controls)]) == said


def test_mechanisms_are_counted_apart_from_controls() -> None:
    both = [*_reports(CONTROL, Outcome.SUPPORTED), *_reports(MECHANISM, Outcome.REFUTED)]
    assert tally(both).endswith("Of 1 case of mechanisms, which test parts of methods and tasks, 1 **refuted**.")
    assert totals(both) == "controls: 1 supported; mechanisms: 1 refuted"


def test_support_that_no_planted_fault_changes_is_counted_apart() -> None:
    sound, insensitive, refuted = _reports("§5", Outcome.SUPPORTED, Outcome.SUPPORTED, Outcome.REFUTED)
    reports = [sound, replace(insensitive, tried=Tried.INSENSITIVE), replace(refuted, tried=Tried.INSENSITIVE)]
    assert tally(reports) == (
        "Of 1 sentence of the paper, 1 **refuted in some case**. By case, of 3: 1 **supported**, 1 **supported but "
        "insensitive** and 1 **refuted**."
    )


def test_support_that_a_null_agent_has_as_well_is_counted_apart() -> None:
    sound, vacuous = _reports("§5", Outcome.SUPPORTED, Outcome.SUPPORTED)
    vacuous = replace(vacuous, satisfied_by=("no action",))
    assert tally([sound, vacuous]) == (
        "Of 1 sentence of the paper, 1 **supported but vacuous**. By case, of 2: 1 **supported** and 1 **supported but "
        "vacuous**."
    )
    assert tally([replace(vacuous, tried=Tried.SENSITIVE)]).startswith(
        "Of 1 sentence of the paper, 1 **supported in every case**."
    )
