"""The report as Markdown: nothing in a text is taken for markup, and tables keep their shape."""

from __future__ import annotations

from html import escape

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from laboratory import HERE, Laboratory, better_solves, better_wins
from markdown_it import MarkdownIt

from evoclaims.report.formatting import clean, literal
from evoclaims.report.markdown import markdown

READER = MarkdownIt("commonmark").enable(["table", "strikethrough"])


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


def test_the_report_has_the_scoreboard_and_every_claim(filled: Laboratory) -> None:
    reports = [filled.judge(better_wins), filled.judge(better_solves, id="T2", tier="smoke")]
    text = markdown(filled.page(*reports, sentences={"T2": "It is solved"}))
    assert text.startswith("# A Tiny Paper\n")
    assert "| full | 1 | 0 | 0 | 0 | 0 | 0 |" in text
    assert "| [T1](#T1-full) | §1.2, Fig. 3 | ✓ supported | 6 | 1.00 | 0.0011 (0.0011) |" in text
    assert "> It is solved\n>\n> §1.2, Fig. 3\n\nJudged at this tier: In small" in text
    assert "Made by: 12 trials on cpu, aaaaaaaaa, clean" in text
    assert text.count("<a id=") == 2
    rendered = READER.render(text)
    assert rendered.count("<table>") == 3


@pytest.mark.parametrize("text", ["<script>alert(1)</script>", "[x](javascript:alert(1))", "a | b\n\n# c"])
def test_hostile_sentences_and_versions_make_no_markup(filled: Laboratory, text: str) -> None:
    filled.put("neat", [1.0] * 6, provenance={**HERE, "device": {"kind": text, "platform": "cpu"}})
    report = filled.judge(lambda group: group("neat").solves_every_level.in_most_trials(), says=text, where=text)
    rendered = READER.render(markdown(filled.page(report)))
    assert "<script" not in rendered
    assert 'javascript:alert(1)"' not in rendered
    assert rendered.count("<h1>") == 1
    assert rendered.count("<td") == 8 + 6
