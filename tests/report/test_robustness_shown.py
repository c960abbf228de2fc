"""Claims against variants of the protocol, in the page and in Markdown."""

from __future__ import annotations

from dataclasses import replace

from hand_made_verdicts import report
from unpacked import whole

from evoclaims.report.html import html
from evoclaims.report.model import Board, Page, Section
from evoclaims.verdicts.claim_report import Tally
from evoclaims.verdicts.transitions import Robustness

ROW = Robustness("G1[<b>]", "smoke", Tally.REFUTED, {"network": Tally.SUPPORTED, "rows": Tally.REFUTED})
OTHER = Robustness("G2", "smoke", Tally.SUPPORTED, {"rows": Tally.SUPPORTED})
PAGE = Page(
    title="A Paper",
    name="paper",
    boards=(),
    variants={"network": "another <network>", "rows": "other rows", "never": "never run"},
    robustness=(ROW, OTHER),
)


def test_the_page_sets_off_what_hangs_on_a_detail() -> None:
    text = whole(PAGE)
    assert "<b>supported</b>" in text
    assert "<b>refuted</b>" not in text
    assert "another &lt;network&gt;" in text
    assert "G1[&lt;b&gt;]" in text
    assert "never run" not in text


def test_a_verdict_stands_out_from_no_protocol_that_has_not_run() -> None:
    alone = replace(PAGE, robustness=(Robustness("G3", "full", Tally.NOT_RUN, {"rows": Tally.REFUTED}),))
    assert "<b>refuted</b>" not in whole(alone)


def test_the_heading_of_a_variant_is_shown_whole() -> None:
    board = Board("smoke", (Section(report("G1"), "G1", (), ("§1",)),))
    row = Robustness("G1", "smoke", Tally.SUPPORTED, {"large_<network>": Tally.SUPPORTED})
    page = replace(PAGE, boards=(board,), variants={"large_<network>": "a larger one"}, robustness=(row,))
    assert '<span class="variant" title="a larger one">large_&lt;network&gt;</span>' in html(page)
