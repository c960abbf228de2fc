"""Verdicts as Markdown: complete, in order, and no text of a claim is taken for markup."""

from __future__ import annotations

import re
from html import escape

from hand_made_verdicts import report
from hypothesis import example, given
from hypothesis import strategies as st
from markdown_it import MarkdownIt

from evoclaims.report.formatting import clean, literal
from evoclaims.report.run_summary import run_summary

READER = MarkdownIt("commonmark").enable(["table", "strikethrough"])
HOSTILE = "a | b `c` <script>alert(1)</script> & *d* _e_ [f](http://g) \n| new row |\r\n# heading \x1b[2J www.h.i @all"


def _rows(text: str) -> list[list[str]]:
    """Return the cells of the table's body, as a reader of GitHub's Markdown sees its bars."""
    lines = [line for line in text.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines[2:]]


def test_a_row_shows_claim_sentence_verdict_n_p_and_why_between_totals_and_notes() -> None:
    plain, accepted = report("G1", "refuted", case="n_parity"), report("G2", expected="supported", because="known")
    text = run_summary([plain, accepted], ["1 changed", "a*b"])
    assert _rows(text) == [
        [
            *(r"G1\[n\_parity\] (smoke)", "All levels are solved (§5.1)", "✗ refuted", "10", "against 0.0043"),
            "for a reason",
        ],
        [
            *("G2 (smoke)", "All levels are solved (§5.1)", r"✓ supported\*", "10", "0.028"),
            "for a reason; examined and accepted: known",
        ],
    ]
    lines = text.splitlines()
    assert lines[:3] == ["## Claims", "", "**1 supported, 1 refuted**"]
    assert lines[-2:] == ["* 1 changed", r"* a\*b"]


def test_hostile_sentences_stay_in_their_cells() -> None:
    fields = dict.fromkeys(("case", "statement", "where", "reason", "because", "tier"), HOSTILE)
    text = run_summary([report("G1", "refuted", expected="refuted", **fields), report("G2")], [HOSTILE])
    assert len(_rows(text)) == 2
    assert {len(row) for row in _rows(text)} == {6}
    assert "<" not in text
    assert "\x1b" not in text
    assert not re.search(r"(?<!\\)[`\[\]]", text)
    assert not re.search(r"&(?!(amp|lt|gt);)", text)
    assert len(text.splitlines()) == 11


@given(st.text(st.characters(exclude_categories=()), max_size=40))
def test_any_text_becomes_one_line_without_live_marks(text: str) -> None:
    shown = literal(text)
    assert len(shown.splitlines()) <= 1
    assert not re.search(r"(?<!\\)(?:\\\\)*[|`*_\[\]<>#]", shown)
    shown.encode()


@given(st.text())
@example("1. not a list")
@example("- *a* _b_ `c` [d](http://e) <b>&amp; | ~~f~~ # g \\ http://h.i www.j.k + > !")
@example("====")
@example("- item")
@example("+ item")
@example("12) item")
def test_any_text_is_shown_as_it_is(text: str) -> None:
    shown = escape(clean(text), quote=False).replace('"', "&quot;")
    assert READER.render(literal(text)) == (f"<p>{shown}</p>\n" if shown else "")


@given(st.text(min_size=1))
def test_any_text_stays_in_its_cell(text: str) -> None:
    rendered = READER.render(f"| a | b |\n| --- | --- |\n| {literal(f'x{text}')} | y |\n")
    assert rendered.count("<td>") == 2
    assert "<td>y</td>" in rendered
