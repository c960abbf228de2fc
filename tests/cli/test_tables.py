"""`evoclaims tables`: tables in Markdown files, from the reference trials alone."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from tiny_project import Evoclaims, Project

from evoclaims.trials.store import Store

PAGE = """# Title

<!-- evoclaims: verdicts full smoke smoke:traded -->
An old table.
<!-- evoclaims: end -->

The rest.
"""


@pytest.fixture
def committed(evoclaims: Evoclaims, stored: Store) -> Evoclaims:
    """The trials of the right and the wrong network are reference trials, and no store is left."""
    assert evoclaims("reference")[0] == 0
    shutil.rmtree(".evoclaims")
    Path("page.md").write_text(PAGE)
    return evoclaims


def test_a_table_is_written_between_its_marks_once(committed: Evoclaims, project: Project) -> None:
    assert committed("tables", "page.md") == (1, "page.md: changed\n", "")
    text = Path("page.md").read_text()
    assert text.startswith(PAGE.partition("An old")[0])
    assert text.endswith("<!-- evoclaims: end -->\n\nThe rest.\n")
    lines = text.splitlines()
    assert "| claim | the paper says | full | smoke | smoke, traded |" in lines
    assert (
        "| a | a at full size | not run | **supported** (10 of 10 trials; A) | **refuted** (0 of 10 trials; A) |"
        in lines
    )
    assert "| b | b at full size | not run | **refuted** (0 of 10 trials; A) | – |" in lines
    (legend,) = [line for line in lines if line.startswith("* A: cpu; ")]
    assert "jax " in legend
    assert "python " in legend
    assert any(line.startswith("In parentheses") and "*not run*" in line and "–: the variant" in line for line in lines)
    assert committed("tables", "page.md") == (0, "page.md: as it was\n", "")
    assert "An old table" not in text
    Path("page.md").write_text(PAGE.replace("full smoke smoke:traded", "smoke"))
    committed("tables", "page.md")
    assert "not run" not in Path("page.md").read_text()
    assert "variant" not in Path("page.md").read_text()


MARKS = """<!-- evoclaims: marks small=smoke smoke:traded full -->

| claim | the paper says |
| --- | --- |
| a | A, in short |

<!-- evoclaims: end -->
"""


def test_marks_are_one_for_each_sentence_and_short_sentences_stay(committed: Evoclaims, project: Project) -> None:
    project.write(
        """
@says("a")
@pytest.mark.parametrize("method", ["right", "wrong", "coin"])
def test_a(trials, verdict, method):
    verdict(trials(method, on="parity").solves_every_level.in_most_trials())

@says("b is a sentence of many more words than ten, so that")
def test_b(trials, verdict):
    verdict(trials("wrong", on="parity").solves_every_level.in_most_trials())

@claim("c", says="c", where="control", smoke="c")
def test_c(trials, verdict):
    verdict(trials("right", on="parity").solves_every_level.in_most_trials())
"""
    )
    Path("page.md").write_text(MARKS)
    committed("tables", "page.md")
    lines = [line for line in Path("page.md").read_text().splitlines() if line.startswith("| ")]
    assert lines == [
        "| claim | the paper says | small | smoke, traded | full |",
        "| --- | --- | --- | --- | --- |",
        "| a | A, in short | ✓1 ✗1 –1 | ✗1 –2 | – |",
    ]
    Path("page.md").write_text(MARKS.replace("| a | A, in short |\n", ""))
    committed("tables", "page.md")
    assert "| b is a sentence of many more words than ten, … | ✗ | – | – |" in Path("page.md").read_text()


def test_a_table_of_details_has_the_claims_that_a_variant_touches(committed: Evoclaims) -> None:
    Path("page.md").write_text(PAGE.replace("verdicts full smoke smoke:traded", "details smoke"))
    assert committed("tables", "page.md")[0] == 1
    lines = Path("page.md").read_text().splitlines()
    assert "| claim | tier | the protocol | traded |" in lines
    assert [line for line in lines if line.startswith(("| a", "| b"))] == ["| a | smoke | supported | **refuted** |"]
    assert not any(line.startswith("Not run") for line in lines)
    Path("page.md").write_text(PAGE.replace("verdicts full smoke smoke:traded", "details full"))
    committed("tables", "page.md")
    assert "No claim's trials have all run under: traded." in Path("page.md").read_text()


def test_a_store_changes_no_table(committed: Evoclaims, trials_of_both: Path) -> None:
    committed("tables", "page.md")
    shutil.rmtree("reference")
    shutil.copytree(trials_of_both, ".evoclaims")
    assert committed("tables", "page.md")[0] == 1
    assert "**supported**" not in Path("page.md").read_text()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("# Nothing\n", "There is no table to write"),
        (PAGE.replace("verdicts", "verdict"), "There is no kind of table named 'verdict'. Did you mean 'verdicts'?"),
        (PAGE.replace("verdicts full", "verdicts ful"), "There is no tier named 'ful'."),
        (PAGE.replace("smoke:traded", "smoke:trade"), "There is no variant named 'trade'."),
        (PAGE.replace("verdicts", "tally"), "shows one tier, not full, smoke, smoke:traded. Write one table for each."),
        (PAGE.replace("verdicts full smoke smoke:traded", "details full smoke"), "shows one tier, not full, smoke."),
        (PAGE.replace("verdicts full smoke smoke:traded", "tally ful"), "There is no tier named 'ful'."),
        (
            f"<!-- evoclaims: tally smoke -->\n\nProse.\n\n{PAGE}",
            "tally smoke --> has no <!-- evoclaims: end --> before",
        ),
        (f"{PAGE}\n<!-- evoclaims: tally smoke -->\n", "tally smoke --> has no <!-- evoclaims: end --> before"),
        (None, "Cannot read page.md: No such file or directory."),
    ],
)
def test_a_mistake_is_a_sentence(committed: Evoclaims, text: str | None, said: str) -> None:
    Path("page.md").unlink() if text is None else Path("page.md").write_text(text)
    status, _, err = committed("tables", "page.md")
    assert (status, said in " ".join(err.split())) == (2, True), err
    assert text is None or Path("page.md").read_text() == text
