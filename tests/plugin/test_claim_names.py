"""A claim test's name is its own: no verdict takes the place of another's."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest

from evoclaims.cli import main
from evoclaims.verdicts import history

Sentence = Callable[[pytest.RunResult, str], None]

PAIRS = [("a", "a-smoke"), ("日本", "中国"), ("x" * 300, "x" * 299 + "y")]
"""Ids of parameters that are easily taken for one another."""

PAIR = """
@pytest.mark.parametrize("method", [pytest.param("wrong", id={0!r}), pytest.param("right", id={1!r})])
@says("G1")
def test_pair(trials, verdict, method):
    verdict(trials(method, on="parity").solves_every_level.in_most_trials())
"""


@pytest.mark.parametrize("ids", PAIRS)
def test_claims_whose_parameters_are_called_alike_keep_their_own_verdicts(project: Any, ids: tuple[str, str]) -> None:
    option = "disable_test_id_escaping_and_forfeit_all_rights_to_community_support"
    with (project.path / "pyproject.toml").open("a") as file:
        file.write(f"\n{option} = true\n")
    project.write(PAIR.format(*ids))
    result = project.run("--claims-json=out.json", own_store=True)
    assert result.ret == 1
    reports = json.loads((project.path / "out.json").read_text())["claims"]
    cases = {report["case"]: report["outcome"] for report in reports}
    assert cases == dict(zip(ids, ("refuted", "supported"), strict=True))
    files = sorted((project.path / ".evoclaims" / "verdicts" / "smoke").iterdir())
    assert {report["evidence"] for report in reports} == {str(file) for file in files}
    assert sorted(json.loads(file.read_text())["outcome"] for file in files) == ["refuted", "supported"]
    assert main(["accept", "--tier=smoke"]) == 1
    accepted = history.load(project.path / "verdicts.toml")
    assert sorted(entries[-1].outcome for entries in accepted.values()) == ["refuted", "supported"]


SAME = "@says('G1')\ndef test_{0}(trials, verdict):\n    verdict(trials('{0}', on='parity').mean_success > 0)\n"
PARTS = """
@pytest.mark.parametrize("other", ["c", "b-c"])
@pytest.mark.parametrize("one", ["a", "a-b"])
@says("G1")
def test_parts(trials, verdict, one, other):
    pass
"""
IN_THE_ID = """
@says("G1[a]")
def test_first(trials, verdict):
    pass

@pytest.mark.parametrize("letter", ["a"])
@says("G1")
def test_second(trials, verdict, letter):
    pass
"""


@pytest.mark.parametrize(
    ("text", "name", "tests"),
    [
        (SAME.format("right") + SAME.format("wrong"), "G1", ("test_right[G1-smoke]", "test_wrong[G1-smoke]")),
        (PARTS, "G1[a-b-c]", ("test_parts[a-b-c-G1-smoke]",)),
        (IN_THE_ID, "G1[a]", ("test_first[G1_a_-smoke]", "test_second[a-G1-smoke]")),
    ],
)
def test_two_claim_tests_of_one_name_are_a_sentence_that_names_both(
    project: Any, sentence: Sentence, text: str, name: str, tests: tuple[str, ...]
) -> None:
    project.write(text)
    result = project.run(own_store=True)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    sentence(result, f"Two claim tests at the smoke tier are called {name}: ")
    for test in tests:
        sentence(result, f"claims/test_claims.py::{test}")
    assert not (project.path / ".evoclaims" / "trials").exists()


BESIDE = """
@says("X1")
def test_plain(trials, verdict):
    verdict(trials("right", on="parity").mean_success > 0)

@pytest.mark.parametrize("method", ["right", "wrong"])
@says("{0}")
def test_cases(trials, verdict, method):
    verdict(trials(method, on="parity").mean_success > 0)

@pytest.mark.parametrize("method", ["coin"])
@claim("{0}", says="another sentence", where="§2", smoke="in small")
def test_other(trials, verdict, method):
    verdict(trials(method, on="parity").mean_success > 0)
"""


def test_a_claim_without_parameters_shares_its_id_with_no_cases_of_another_test(
    project: Any, sentence: Sentence
) -> None:
    project.write(BESIDE.format("X1"))
    result = project.run(own_store=True)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    sentence(
        result, "Two claim tests have the id X1: claims/test_claims.py::test_plain[X1-smoke] without parameters, and"
    )
    sentence(result, "claims/test_claims.py::test_cases[right-X1-smoke] with some. So X1 would name")
    project.write(BESIDE.format("X2"))  # two sentences under one id, each with its own cases
    assert project.run("--collect-only").ret == 0


CLASS = """
import unittest

class TestOld(unittest.TestCase):
    @says("G1")
    def test_it(self):
        pass
"""


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (CLASS, "TestOld::test_it is a claim that cannot run at a tier. Write it as a function"),
        ("@pytest.mark.claim\ndef test_a(trials):\n    pass\n", "has the mark pytest.mark.claim but no claim"),
    ],
)
def test_a_claim_that_would_never_be_judged_is_a_sentence(
    project: Any, sentence: Sentence, text: str, said: str
) -> None:
    project.write(text)
    result = project.run(own_store=True)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    sentence(result, said)


def test_the_tier_comes_last_whoever_else_gives_parameters(project: Any) -> None:
    project.write("@says('G1')\ndef test_it(trials, verdict, method):\n    pass\n")
    (project.path / "conftest.py").write_text(
        "import pytest\n@pytest.hookimpl(tryfirst=True)\ndef pytest_generate_tests(metafunc):\n"
        "    metafunc.parametrize('method', ['right', 'smoke-wrong'])\n"
    )
    assert {report["case"] for report in project.json()["claims"]} == {"right", "smoke-wrong"}
