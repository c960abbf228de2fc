"""What became of a claim is the test's outcome: letter, words, exit status, files."""

from __future__ import annotations

import json
import re
from itertools import dropwhile, takewhile
from typing import Any
from xml.etree import ElementTree

import pytest


def _letters(result: pytest.RunResult) -> str:
    """Return what pytest printed for the tests, without the progress lines of trials in between."""
    lines = iter(result.outlines)
    body = takewhile(lambda line: not line.startswith("="), dropwhile(lambda line: "collected" not in line, lines))
    kept = " ".join(line for line in list(body)[1:] if not line.startswith("  "))
    return re.sub(r"claims/test_claims.py|\[ *\d+%\]|\s", "", kept)


@pytest.mark.parametrize(
    ("body", "letter", "word", "status"),
    [
        ("supported", "✓", "supported", 0),
        ("refuted", "✗", "refuted", 1),
        ("undecided", "?", "inconclusive", 0),
        ("error", "E", "error", 1),
    ],
)
def test_a_verdict_shows_as_letter_word_and_exit_status(
    project: Any, body: str, letter: str, word: str, status: int
) -> None:
    project.write(**{body: body})
    result = project.run("--claims-device=cpu")
    assert result.ret == status
    assert _letters(result) == letter
    result.stdout.fnmatch_lines(["*= claims =*", f"{body} *{body} in small (§1)*{letter} {word}*", f"claims: 1 {word}"])
    assert re.fullmatch(rf"=+ 1 deselected, 1 {word} in .*s =+", result.outlines[-1])


def test_the_words_of_a_verbose_run_are_the_outcomes(project: Any) -> None:
    project.write(a="supported", b="undecided")
    project.run()  # of trials that are stored there is no progress to tell between a test's name and its outcome
    result = project.run("-v")
    result.stdout.fnmatch_lines(["*::test_a?a-smoke? SUPPORTED*", "*::test_b?b-smoke? INCONCLUSIVE*"])


@pytest.mark.parametrize(
    "marks",
    [
        "@says('b', expect=Outcome.REFUTED, because='the paper errs')",
        "@expected('refuted', because='the paper errs')\n@says('b')",
        "@expected('refuted', because='the paper errs', tier='smoke')\n@says('b')",
    ],
)
def test_a_refutation_that_was_accepted_ends_well_and_stays_visible(project: Any, marks: str) -> None:
    body = "verdict(trials('wrong', on='parity').solves_every_level.in_most_trials())"
    project.write(f"{marks}\ndef test_b(trials, verdict):\n    {body}\n")
    result = project.run("-v")
    assert result.ret == 0
    result.stdout.fnmatch_lines(["*REFUTED (ACCEPTED)*", "*✗ refuted[*]*", "*accepted: the paper errs*"])


def test_an_acceptance_for_another_tier_or_outcome_accepts_nothing(project: Any) -> None:
    body = "verdict(trials('wrong', on='parity').solves_every_level.in_most_trials())"
    project.write(
        f"@expected('refuted', because='x', tier='full')\n@says('b')\ndef test_b(trials, verdict):\n    {body}\n"
        f"@expected('error', because='y')\n@says('c')\ndef test_c(trials, verdict):\n    {body}\n"
    )
    result = project.run()
    assert (result.ret, _letters(result)) == (1, "✗✗")
    result.stdout.fnmatch_lines(["*no longer error, which was accepted: y*"])


def test_one_parameter_of_a_claim_can_be_accepted_by_itself(project: Any) -> None:
    project.write(
        "@pytest.mark.parametrize('method', "
        "['right', pytest.param('wrong', marks=expected('refuted', because='known'))])\n"
        "@says('b')\ndef test_b(trials, verdict, method):\n"
        "    verdict(trials(method, on='parity').solves_every_level.in_most_trials())\n"
    )
    result = project.run()
    assert result.ret == 0
    result.stdout.fnmatch_lines(["b?right? *✓ supported*", "b?wrong? *✗ refuted[*]*"])


def test_a_bare_assert_cannot_bypass_the_judge(project: Any) -> None:
    project.write(a="assert trials('right', on='parity').mean_success > trials('wrong', on='parity').mean_success")
    result = project.run()
    assert (result.ret, _letters(result)) == (1, "E")
    result.stdout.fnmatch_lines(["*TypeError: *Write verdict(a > b) instead of assert a > b; *"])


@pytest.mark.parametrize(
    ("body", "text"),
    [
        ("pass", "the test ended without calling verdict(...), so it judged nothing"),
        ("verdict(True)", "verdict(...) takes an assertion about trials"),
        (
            "a = trials('right', on='parity').solves_every_level.in_most_trials(); verdict(a); verdict(a)",
            "A claim has one verdict: join several assertions with & (and) or | (or).",
        ),
        (
            "trials('rigth', on='parity')",
            "There is no method named 'rigth'. Did you mean 'right'? Known: broken, coin,",
        ),
        (
            "trials('right', 'parity')",
            "trials('right', 'parity') names no task. Write trials('right', on='p",
        ),
        ("trials('right')", "trials('right') names no task. Write trials('right', on=task)."),
        (
            "verdict(trials('right', on='parity').solves_every_level.in_most_trials)",
            "verdict(...) was given the function in_most_trials itself: call it, as in in_most_trials().",
        ),
        ("trials('right', on='partiy')", "There is no task for right named 'partiy'. Did you mean 'parity'? Known: pa"),
    ],
)
def test_a_claim_that_cannot_be_judged_is_an_error_in_one_sentence(project: Any, body: str, text: str) -> None:
    project.write(a=body)
    result = project.run()
    assert (result.ret, _letters(result)) == (1, "E")
    assert text in " ".join(result.stdout.str().split())
    result.stdout.no_fnmatch_line("*Traceback*")
    result.stdout.no_fnmatch_line("*test_claims.py:[0-9]*")


def test_the_json_report_holds_all_verdicts(project: Any) -> None:
    project.write(a="supported", b="refuted")
    plain = project.json()
    assert plain["schema"] == 1
    first, second = plain["claims"]
    assert (first["claim"], first["tier"], first["outcome"], first["statement"]) == (
        "a",
        "smoke",
        "supported",
        "a in small",
    )
    assert (second["outcome"], second["verdict"]["n"]) == ("refuted", 10)
    assert first["verdict"]["p"] <= 0.05
    assert first["verdict"]["attainable_p"] <= first["verdict"]["p"]
    assert len(first["verdict"]["evidence"][0]["samples"][0]["values"]) == 10
    assert [len(source["trials"]) for source in first["sources"]] == [10]
    assert {row["status"] for row in plain["drift"]["rows"]} == {"no reference"}
    assert json.loads((project.store / "verdicts" / "smoke" / "a.json").read_text()) == first


def test_junit_properties_tell_the_verdict(project: Any) -> None:
    project.write(a="supported", b="refuted")
    project.run("--junitxml=out.xml")
    found = {}
    for case in ElementTree.parse(project.path / "out.xml").iter("testcase"):
        properties = {p.get("name"): p.get("value") for p in case.iter("property")}
        assert len(properties) == len(list(case.iter("property"))) == 7
        failures = [failure.get("message") for failure in case.iter("failure")]
        found[properties["claim"]] = (properties["verdict"], properties["tier"], properties["n"], failures)
        (p,) = properties.keys() & {"p", "p_refuted", "p_smaller"}
        assert (p, float(properties[p]) < 0.05) == ("p" if properties["claim"] == "a" else "p_refuted", True)
    assert found["a"] == ("supported", "smoke", "10", [])
    assert found["b"][:3] == ("refuted", "smoke", "10")
    assert found["b"][3][0].startswith("b (smoke) is refuted: p = ")


def test_what_a_claims_own_code_raises_has_its_place_in_the_table(project: Any) -> None:
    project.write(
        """
@says("a")
def test_a(trials, verdict):
    right = trials("right", on="parity")
    verdict(right.event("odd", lambda trial: trial.metric["x"] > 1).in_most_trials())


@says("b")
def test_b(trial, verdict):
    pass
"""
    )
    lines = (project.path / "claims" / "test_claims.py").read_text().splitlines()
    (line,) = (number for number, text in enumerate(lines, start=1) if "metric[" in text)
    result = project.run()
    result.stdout.fnmatch_lines(
        [
            f"E a: AttributeError: 'TrialResult' object has no attribute 'metric' (claims/test_claims.py, line {line})",
            "E b: There is no fixture named 'trial': a claim takes trials and verdict.",
        ]
    )
