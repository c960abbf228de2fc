"""`evoclaims status`: one line for each claim, those that are asked for, and in forms for other programs."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import pytest
from tiny_project import Evoclaims, Project, aged, forget, spoiled, trials_of

from evoclaims.paper import references
from evoclaims.trials.store import Store

CASES = """
@pytest.mark.parametrize("method", ["right", "wrong"])
@says("G1")
def test_first(trials, verdict, method):
    verdict(trials(method, on="parity").solves_every_level.in_most_trials())

@expected(Outcome.REFUTED, because="the paper errs")
@says("G10")
def test_second(trials, verdict):
    verdict(trials("wrong", on="parity").solves_every_level.in_most_trials())

@says("S1")
def test_third(trials, verdict):
    verdict(trials("right", on="parity").solves_every_level.in_most_trials())
"""


@pytest.fixture
def status(evoclaims: Evoclaims, project: Project, stored: Store) -> Evoclaims:
    """`evoclaims status` of four claims, with their trials."""
    project.write(CASES)
    return lambda *arguments: evoclaims("status", *arguments)


@pytest.mark.parametrize(
    ("only", "ended", "shown"),
    [
        ("G1", 1, ["G1[right]", "G1[wrong]"]),
        ("G1[right]", 0, ["G1[right]"]),
        ("G", 1, ["G1[right]", "G1[wrong]", "G10"]),
        ("S, G10", 0, ["G10", "S1"]),
    ],
)
def test_claims_are_chosen_by_id_by_whole_name_and_by_the_letters_of_ids(
    status: Evoclaims, only: str, ended: int, shown: list[str]
) -> None:
    code, out, _ = status("--only", only)
    assert code == ended
    assert [line.split()[0] for line in out.splitlines() if "in small" in line] == shown


def test_claims_that_do_not_exist_are_a_sentence(status: Evoclaims) -> None:
    for only, said in ((" ,", "' ,' names no claim. Name some, such as G1"), ("G11", "no claim named 'G11'. Did you")):
        code, out, err = status(f"--only={only}")
        assert (code, out, said in err) == (2, "", True)


def test_why_a_verdict_failed_is_said_in_any_case_and_the_rest_where_it_is_asked_for(status: Evoclaims) -> None:
    brief, whole = status()[1], status("--why")[1]
    for out, accepted in ((brief, False), (whole, True)):
        assert "✗ G1[wrong]: p = " in out
        assert ("[accepted: the paper errs]" in out) == accepted
        assert ("--why prints why" in out) != accepted
        assert out.splitlines()[-1] == "claims (smoke): 2 supported, 2 refuted"


def test_a_variant_shows_the_verdicts_that_it_may_change_and_which_it_does(status: Evoclaims) -> None:
    """Under `traded` the right network is what the wrong one is."""
    code, out, err = status("--variant=traded")
    assert (code, err) == (0, "")
    assert [line.split()[0] for line in out.splitlines() if "in small" in line] == ["G1[right]", "S1"]
    assert out.splitlines()[-2:] == [
        "traded: The right network is wrong",
        "verdicts that it changes: 2 of 2 (G1[right] supported -> refuted, S1 supported -> refuted)",
    ]
    assert "changes: 1 of 1 (S1 " in status("--variant=traded", "--only=S1")[1]
    assert [row["outcome"] for row in json.loads(status("--variant=traded", "--as=json")[1])["rows"]] == ["refuted"] * 2
    code, out, err = status("--variant=traded", "--only=G1[wrong]")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "is judged under traded: it changes none of their trials" in err


def test_an_error_under_a_variant_is_no_verdict_and_fails_as_in_pytest(status: Evoclaims, project: Project) -> None:
    project.write("""
@says("E1")
def test_lacks_its_number(trials, verdict):
    verdict(trials("right", on="parity").event("odd", lambda trial: trial.metrics["odd"] > 0).in_most_trials())
""")
    code, out, _ = status("--variant=traded")
    assert (code, out.count("There is no 'odd' in the finished trial")) == (1, 1)
    assert project.run("-m", "smoke", "--claims-variant=traded").ret == 1


def test_other_programs_read_the_same_verdicts(status: Evoclaims) -> None:
    code, out, _ = status("--as=json")
    assert code == 1
    told = json.loads(out)["rows"]
    assert [(row["claim"], row["case"], row["outcome"]) for row in told] == [
        ("G1", "right", "supported"),
        ("G1", "wrong", "refuted"),
        ("G10", "", "refuted"),
        ("S1", "", "supported"),
    ]
    rows = csv.DictReader(io.StringIO(status("--as=csv")[1]))
    assert [row["outcome"] for row in rows] == [row["outcome"] for row in told]
    assert "| S1 (smoke) | S1 in small (§1) | ✓ supported | 10 |" in status("--as=markdown")[1]
    assert "There is no form of a table named 'jsn'. Did you mean 'json'?" in status("--as=jsn")[2]


@pytest.mark.parametrize("command", ["status", "accept", "report"])
def test_a_torn_line_among_the_reference_trials_is_found_before_anything_is_judged(
    evoclaims: Evoclaims, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    path = references.path_of(Path("reference"), "smoke", "right", "parity")
    path.parent.mkdir(parents=True)
    path.write_text("torn\n")
    monkeypatch.setattr("evoclaims.cli.project.Project.judge_sessions", None)
    code, _, err = evoclaims(command)
    assert (code, err.count("\n")) == (2, 1)
    assert "reference/smoke/right-parity.jsonl is not a reference trial" in err


def test_a_verdict_from_reference_trials_alone_is_told_as_one(
    status: Evoclaims, evoclaims: Evoclaims, stored: Store
) -> None:
    assert "judged from committed" not in status()[1]
    assert evoclaims("reference")[0] == 0
    for record in stored.record_files(references.load(Path("reference/smoke/right-parity.jsonl"))[3].id):
        record.unlink(missing_ok=True)
    told = "judged from committed reference trials, since the store has no better ones"
    assert status()[1].splitlines()[-1] == f"{told}: 2 of 4 of these claims"
    assert status("--only", "S1")[1].splitlines()[-1] == f"{told}: all of these claims"


def test_a_verdict_from_reference_trials_that_go_before_older_ones_is_told_too(
    status: Evoclaims, evoclaims: Evoclaims, stored: Store
) -> None:
    assert evoclaims("reference")[0] == 0
    right = trials_of(stored, "hand_built")
    forget(stored, right)
    for trial in right:
        stored.put(aged(spoiled(trial)), {})
    lines = status("--only", "S1")[1].splitlines()
    assert "claims (smoke): 1 supported" in lines
    assert (
        lines[-1] == "judged from committed reference trials, since the store has no better ones: all of these claims"
    )


def test_a_pipe_has_lines_of_100_columns_at_most(
    status: Evoclaims, project: Project, monkeypatch: pytest.MonkeyPatch
) -> None:
    sentence = "It is said at some length " * 8
    project.write(CASES.replace('@says("S1")', f'@claim("S1", says="{sentence}", where="§1", smoke="{sentence}")'))
    monkeypatch.delenv("COLUMNS")
    assert max(map(len, status("--why")[1].splitlines())) == 100
    monkeypatch.setenv("COLUMNS", "300")
    assert sentence.strip() in status()[1]
    monkeypatch.setenv("COLUMNS", "80")
    assert 75 <= max(map(len, status("--why")[1].splitlines())) <= 80  # as wide as its words allow
    assert 65 <= max(map(len, (line for line in project.run().outlines if "S1" in line))) <= 80


def test_controls_are_counted_apart(status: Evoclaims, project: Project) -> None:
    project.write(CASES.replace('@says("S1")', '@claim("C1", says="It works", where="control", smoke="It works")'))
    assert "claims (smoke): 1 supported, 2 refuted; controls: 1 supported" in status()[1]
