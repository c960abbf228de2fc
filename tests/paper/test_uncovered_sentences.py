"""Sentences of a paper without a claim: a file of them, in the paper's order."""

from __future__ import annotations

from pathlib import Path

import pytest

from evoclaims.core.errors import UserError
from evoclaims.paper.reported import SENTENCES_FILE as FILE
from evoclaims.paper.reported import Uncovered, uncovered

ONE = '[[sentence]]\nline = {}\nsays = "a"\nbecause = "b"\n'


def test_sentences_are_read_in_the_papers_order(tmp_path: Path) -> None:
    assert uncovered(tmp_path) == ()
    (tmp_path / FILE).write_text(ONE.format(9) + ONE.format(3))
    assert uncovered(tmp_path) == (Uncovered(3, "a", "b"), Uncovered(9, "a", "b"))


@pytest.mark.parametrize("text", ["[[sentence", "[[sentence]]\nline = 3\n", ONE.format('"x"'), "sentence = 3\n"])
def test_a_file_that_holds_something_else_is_a_sentence(tmp_path: Path, text: str) -> None:
    (tmp_path / FILE).write_text(text)
    with pytest.raises(UserError, match=r"Cannot read .*sentences.toml: .* with line \(a number\), says and because"):
        uncovered(tmp_path)
