"""Published numbers beside ours, in the page and in Markdown; and what the paper's own numbers would not pass."""

from __future__ import annotations

from dataclasses import replace

from laboratory import Laboratory, better_solves, better_wins
from unpacked import whole

from evoclaims.figures.replication import Replication
from evoclaims.figures.trial_numbers import TrialNumber, TrialNumbers
from evoclaims.judging.repetition import Agreement, PublishedMean, repetition
from evoclaims.judging.verdict import Outcome
from evoclaims.paper.reported import Reported
from evoclaims.report import replication_cells
from evoclaims.report.build import gather
from evoclaims.report.model import Page


def _number(values: list[float], error: float | None = 20.0, variant: str = "") -> Replication:
    numbers = TrialNumbers(
        "<neat>", "maze", "reward", tuple(TrialNumber(seed, "", "done", x, x) for seed, x in enumerate(values))
    )
    found = repetition(PublishedMean(900.0, error, 10), values, 10)
    return Replication("full", variant, Reported(900.0, error, "Fig. 1", 10), numbers, found)


NUMBERS = (_number([700.0, 900.0] * 5), _number([900.0] * 10, variant="rows"), _number([]))
PAGE = Page(title="A Paper", name="paper", boards=(), numbers=NUMBERS, put_to_the_paper=("G2 <would> not pass",))


def test_cells_say_what_is_published_what_is_ours_and_whether_it_repeats() -> None:
    first, second, third = map(replication_cells.cells, NUMBERS)
    assert first == (
        "<neat> on maze: reward",
        "the protocol",
        "900 ± 20",
        "800 ± 110 (10)",
        "✗ contradicted",
        "879.8 to 920.2 (SD: outside); 836 to 964 (SE: outside)",
    )
    assert (second[1], second[4]) == ("rows", "? uninformative (13)")
    assert third[3:] == ("–", "- cannot be said", "879.8 to 920.2 (SD); 836 to 964 (SE)")
    assert replication_cells.answer(_number([], error=None)) == "- cannot be said: not run"


def test_the_page_has_a_line_for_each_number_and_escapes_it() -> None:
    text = whole(PAGE)
    assert "Do the numbers replicate?" in text
    assert "&lt;neat&gt; on maze: reward" in text
    for colour, answer in (
        ("inconclusive", "? uninformative (13)"),
        ("refuted", "✗ contradicted"),
        ("not_run", "- cannot be said"),
    ):
        assert f'<td class="is-{colour}">{answer}</td>' in text
    assert "G2 &lt;would&gt; not pass" in text
    assert replication_cells.HOW.split(",")[0] in text


def test_a_claim_that_the_papers_own_numbers_would_not_pass_says_so(filled: Laboratory) -> None:
    """Here the trials at hand stand for the paper's: `better` does not solve, but is better."""
    solves, wins = filled.judge(better_solves, id="T1"), filled.judge(better_wins, id="T2")
    assert (solves.outcome, wins.outcome) == (Outcome.REFUTED, Outcome.SUPPORTED)
    control, unknown = replace(solves, where="control"), replace(solves, outcome=Outcome.ERROR)
    for papers, told in (((solves, wins), True), ((control, wins), False), ((unknown, wins), False), ((), False)):
        page = gather(
            filled.reproduction, {"full": [solves, wins]}, filled.archive, {}, sentences={}, put_to_the_paper=papers
        )
        first, second = page.sections
        assert any("the paper's own numbers would not pass this assertion" in line for line in first.warnings) is told
        assert not any("would not pass" in line for line in second.warnings)
        assert bool(page.put_to_the_paper) is bool(papers)
    assert Agreement.OPEN not in {number.agreement for number in NUMBERS[:2]}
