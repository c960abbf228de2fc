"""`evoclaims replicate`: what it prints and writes."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest
from tiny_project import Evoclaims, Project

from evoclaims.trials.store import Store

REPORTED = """
trials = 10

[plots.parity.mean_success]
place = "Fig. 1"
scale = [0, 1]
methods.right.mean = [1]
methods.wrong = { mean = [0.6], error = [0.05] }
methods.coin = { mean = [0.5], error = [0.2] }
"""


@pytest.fixture(autouse=True)
def _published(project: Project, stored: Store) -> None:
    """The paper has published three numbers; two of them have trials."""
    Path("reported.toml").write_text(REPORTED)


def test_each_number_has_a_line_with_ours_and_the_interval(evoclaims: Evoclaims) -> None:
    status, out, err = evoclaims("replicate", "--tier=smoke")
    assert (status, err) == (0, "")
    lines = [" ".join(line.split()) for line in out.splitlines()]
    heading = lines.index("parity: mean success over levels")
    assert lines[heading + 1 : heading + 5] == [
        "published ours 95% of repetitions",
        "✓ right 1 1 ± 0 (10) 7–10 trials at 1: ours 10",
        "✗ wrong 0.6 ± 0.05 0 ± 0 (10) 0.5494–0.6506 SD ✗, 0.44–0.76 SE ✗",
        "- coin 0.5 ± 0.2 – 0.2977–0.7023 SD",  # a standard error would be too large
    ]
    assert (
        "the protocol: 1 consistent, 1 contradicted, 1 cannot be said; by condition: 1 consistent, 1 contradicted"
        in out
    )


def test_assertions_are_put_to_the_published_numbers(evoclaims: Evoclaims, project: Project) -> None:
    solid = "verdict(trials('right', on='parity').mean_success.between(0.9, 1.0))"
    short = "verdict(trials('wrong', on='parity').mean_success.between(0.9, 1.0))"
    project.write(a=solid, b=short, c="refuted")
    out = " ".join(evoclaims("replicate", "--tier=smoke")[1].split())
    assert (
        "suffice for 2 assertions of the claims. Trials that all are at the published means would pass 1 of them (a)."
        in out
    )
    asserted = "the median of wrong on parity: mean success over levels lies in [0.9, 1]"
    assert f"b: the paper's own numbers would not pass this assertion ({asserted})" in out
    assert "c:" not in out


def test_a_variant_shows_the_numbers_that_it_changes(evoclaims: Evoclaims) -> None:
    """Under `traded` the right network is what the wrong one is."""
    out = evoclaims("replicate", "--tier=smoke", "--variant=traded")[1]
    assert "the protocol" not in out
    assert "\nparity: mean success over levels, traded\n" in out
    assert "traded: 1 contradicted" in out
    both = evoclaims("replicate", "--tier=smoke", "--variant=all")[1]
    assert both.count("\nparity: mean success over levels, the protocol\n") == 1
    assert "the protocol: 1 consistent" in both
    assert "traded: 1 contradicted" in both


def test_files_have_the_same_numbers(evoclaims: Evoclaims) -> None:
    for form in ("csv", "json", "markdown"):
        assert evoclaims("replicate", "--tier=smoke", f"--as={form}") == (
            0,
            f"wrote report/replication.{form}: 3 numbers\n",
            "",
        )
    rows = json.loads(Path("report/replication.json").read_text())["rows"]
    assert [(row["method"], row["ours.mean"], row["answer"], row["agreement"]) for row in rows] == [
        ("right", 1.0, "inside", "consistent"),
        ("wrong", 0.0, "outside", "contradicted"),
        ("coin", None, "cannot be said", "cannot be said"),
    ]
    with Path("report/replication.csv").open() as file:
        assert [row["answer"] for row in csv.DictReader(file)] == [row["answer"] for row in rows]
    table = Path("report/replication.markdown").read_text().splitlines()
    assert table[0] == "| number | protocol | published | ours | replicates | 95% of repetitions |"
    assert len(table) == 5


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("--tier=ful",), "There is no tier named 'ful'."),
        (("--variant=trade",), "There is no variant named 'trade'. Did you mean 'traded'?"),
        (("--as=xml",), "There is no form named 'xml'."),
        (("--variant=traded",), "There are no trials of the full tier under traded whose numbers are published."),
    ],
)
def test_a_mistake_is_a_sentence(evoclaims: Evoclaims, arguments: tuple[str, ...], text: str) -> None:
    status, _, err = evoclaims("replicate", *arguments)
    assert (status, text in " ".join(err.split())) == (2, True)


def test_a_paper_without_numbers_says_where_they_are_read_from(evoclaims: Evoclaims) -> None:
    Path("reported.toml").unlink()
    status, _, err = evoclaims("replicate")
    assert (status, "reported.toml has no published numbers." in " ".join(err.split())) == (2, True)
