"""`evoclaims audit`: what verdicts rest on, and when it ends with 1."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
import unpacked
from tiny_project import Evoclaims, Project

AGENT = """

from evoclaims.paper.reproduction import NullAgent

AGENTS = {
    "zero": NullAgent("no bit right", lambda c: {"metrics": {"furthest_solved": -1.0}}),
    "absent": NullAgent("a method that is not run", method="nobody"),
}
REPRODUCTION = replace(REPRODUCTION, null_agents=AGENTS)
"""
SENTENCE = '[[sentence]]\nline = 4\nsays = "Networks are small"\nbecause = "small has no number"\n'
CLAIMS = """
@claim("A", says="Right ones solve", where="§1", smoke=None, because="no", line=2, read="all", since="2000-01-01")
def test_solves(trials, verdict):
    right = trials("right", on="parity")
    verdict.reading("none", right.does_not_solve_the_last_level.stays(), because="perhaps", since="3000-01-01")
    verdict(right.solves_every_level.in_most_trials())

@claim("B", says="Right ones solve, too", where="§2", smoke=None, because="no", line=3, read="all", since="3000-01-01")
def test_solves_again(trials, verdict):
    verdict(trials("right", on="parity").solves_every_level.in_most_trials())
"""
VACUOUS = """
@claim("V", says="Wrong ones fail", where="§3", smoke=None, because="no", line=9, since="2000-01-01")
def test_fails(trials, verdict):
    verdict(trials("wrong", on="parity").does_not_solve_the_last_level.stays())
"""
BARE = """
@claim("W", says="Wrong ones fail", where="§3", smoke=None, because="no")
def test_fails(trials, verdict):
    verdict(trials("wrong", on="parity").success_everywhere_is(0).in_most_trials())
"""


@pytest.fixture
def audit(evoclaims: Evoclaims, project: Project, kept: Path) -> Evoclaims:
    """`evoclaims audit` of claims, after their trials of the full tier have run; a null agent is declared."""
    paper = project.path / "tiny_paper.py"
    paper.write_text(paper.read_text() + AGENT)
    if not (kept / "store").exists():
        for method in ("right", "wrong"):
            assert evoclaims("run", "--tier=full", method)[0] == 0
        shutil.copytree(".evoclaims", kept / "store")
    shutil.copytree(kept / "store", ".evoclaims", dirs_exist_ok=True)

    def run(*claims: str) -> tuple[int, str, str]:
        project.write("".join(claims))
        return evoclaims("audit")

    return run


def test_readings_duplicates_and_chance_are_shown(audit: Evoclaims) -> None:
    Path("sentences.toml").write_text(SENTENCE)
    status, out, _ = audit(CLAIMS)
    assert status == 0
    lines = out.splitlines()
    assert lines[0].startswith("Of 1 sentence of the paper (B as A counted once), 1 supported in every case. By case")
    assert "Chance alone would support at most 0.1 of 2 tested cases" in lines[0]
    assert "supported and vacuous (satisfied by one of 2 null agents): none" in lines
    assert "  A (supported): supported as “all”; refuted as “none”" in lines
    (late,) = [line for line in lines if ": written 3000-01-01, first trial 2" in line]
    assert late.startswith("  B (supported)")
    assert "  line 4: Networks are small (small has no number)" in lines


def test_a_vacuous_support_ends_with_1_and_so_does_a_claim_without_line_and_date(
    audit: Evoclaims, evoclaims: Evoclaims
) -> None:
    status, out, _ = audit(CLAIMS, BARE)
    assert (status, "claims without the paper's line or a date: 1\n  W\n" in out) == (1, True)
    status, out, _ = audit(CLAIMS, VACUOUS)
    assert status == 1
    assert "supported and vacuous (satisfied by one of 2 null agents): 1\n  V: zero\n" in out
    assert (
        "null agents that could not be put to an assertion: 2\n"
        "  absent (it is not run on the task): A, B, V\n"
        "  zero (there is no 'success'): A, B\n"
    ) in out
    table = evoclaims("status", "--tier=full")[1]
    assert "✓ supported, vacuous" in table
    assert "claims (full): 2 supported, 1 supported but vacuous" in table
    assert evoclaims("report", "--tier=full")[0] == 0
    text = unpacked.read(Path("report/index.html"))
    assert "depends on the reading: supported as “all”; refuted as “none”" in text
    assert "Null agents that satisfy this assertion: zero (no bit right). Not put to it: absent (it is not run" in text


def test_tables_of_readings_and_of_the_rest(audit: Evoclaims, evoclaims: Evoclaims) -> None:
    Path("sentences.toml").write_text(SENTENCE)
    audit(CLAIMS)
    page = Path("page.md")
    page.write_text(
        "".join(f"<!-- evoclaims: {kind} -->\n<!-- evoclaims: end -->\n" for kind in ("readings full", "uncovered"))
    )
    evoclaims("reference", "--tier=full")
    assert evoclaims("tables", "page.md")[0] == 1
    lines = page.read_text().splitlines()
    assert "| A | 2 | Right ones solve | all | 2000-01-01 | supported |" in lines
    assert "|  |  |  | none | 3000-01-01 † | refuted |" in lines
    assert "| 4 | Networks are small | small has no number |" in lines
