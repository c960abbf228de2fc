"""A test of its own may judge a claim's smaller statement: it takes the claim's place at smoke, case by case."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest

WHOLE = """
from evoclaims import without_smoke

@pytest.mark.parametrize("method", ["wrong", pytest.param("coin", marks=without_smoke(because="luck")), "right"])
@expected("refuted", because="one is wrong")
@claim("S1", says="All solve", where="§1")
def test_whole(trials, verdict, method):
    verdict(trials(method, on="parity").solves_every_level.in_most_trials())
"""
SMALL = """
@pytest.mark.parametrize("method", ["right", "wrong"])
@claim.smoke("S1", says="All know a row")
def test_small(trials, verdict, method):
    verdict(trials(method, on="parity").mean_success > (0.9 if method == "right" else -1))
"""
PLACES = [
    "test_small[wrong-S1-smoke]",
    "test_whole[wrong-S1-full]",
    "test_whole[coin-S1-smoke]",
    "test_whole[coin-S1-full]",
    "test_small[right-S1-smoke]",
    "test_whole[right-S1-full]",
]


def _collected(project: Any, *arguments: str) -> list[str]:
    found = project.run("--collect-only", "-q", *arguments).outlines
    return [line.removeprefix("claims/test_claims.py::") for line in found if "::" in line]


def test_a_smoke_test_is_in_the_place_of_its_claim_however_tests_are_chosen(project: Any) -> None:
    project.write(WHOLE + SMALL)
    assert _collected(project, "-m", "smoke or full") == PLACES
    assert _collected(project) == PLACES[::2]
    assert _collected(project, "-m", "full") == PLACES[1::2]
    assert _collected(project, "-k", "test_small") == PLACES[::4]
    assert _collected(project, "--claims-only=S1[right]") == PLACES[4:5]
    assert _collected(project, "claims/test_claims.py::test_small") == PLACES[::4]
    assert _collected(project, "claims/test_claims.py::test_whole") == PLACES[2:3]
    assert _collected(project, "claims/test_claims.py::test_small[right-S1-smoke]") == PLACES[4:5]


REPEATED = """
def pytest_generate_tests(metafunc):
    metafunc.fixturenames.append("repetition")
    metafunc.parametrize("repetition", [1, 2])
"""


def test_each_tier_judges_the_statement_and_the_outcome_of_its_own_test(project: Any, stored: Any) -> None:
    """And so they are where a plugin repeats the tests; `stored` has no trials of the full tier."""
    project.write(WHOLE + SMALL)
    for repeated in ("", REPEATED):
        (project.path / "conftest.py").write_text(repeated)
        project.run("-m", "smoke or full", "--claims-stored", "--claims-json=out.json", own_store=True)
        plain = json.loads((project.path / "out.json").read_text())["claims"]
        assert [(one["tier"], one["case"], one["statement"], one["outcome"], one["expected"]) for one in plain] == [
            ("full", "coin", "All solve", "not run", "refuted"),
            ("full", "right", "All solve", "not run", "refuted"),
            ("full", "wrong", "All solve", "not run", "refuted"),
            ("smoke", "coin", "All solve", "not run", None),
            ("smoke", "right", "All know a row", "supported", None),
            ("smoke", "wrong", "All know a row", "supported", None),
        ]


IN_CLASSES = """
class TestBase:
    @claim("S1", says="All solve", where="§1")
    def test_whole(self, trials, verdict): ...

    @claim.smoke("S1", says="Some solve")
    def test_small(self, trials, verdict): ...

class TestHeir(TestBase):
    @staticmethod
    @claim("S2", says="All solve", where="§1")
    def test_whole(trials, verdict): ...

    @claim.smoke("S2", says="Some solve")
    def test_small(self, trials, verdict): ...
"""


def test_methods_of_classes_are_paired_within_their_class(project: Any) -> None:
    project.write(IN_CLASSES)
    assert _collected(project, "-m", "smoke or full") == [
        "TestBase::test_small[S1-smoke]",
        "TestBase::test_whole[S1-full]",
        "TestHeir::test_small[S2-smoke]",
        "TestHeir::test_whole[S2-full]",
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (WHOLE, 'The claim S1 of test_whole has no smoke test. Write one below it, with @claim.smoke("S1", says=...)'),
        (SMALL, "test_small is a smoke test of S1, and no test above it has the claim S1."),
        (SMALL + WHOLE, "test_small is a smoke test of S1, and no test above it has the claim S1."),
        (
            WHOLE + SMALL + SMALL.replace("small", "tiny"),
            "test_tiny is a smoke test of S1, which has test_small already",
        ),
        (WHOLE.replace("§1", '§1", smoke="x') + SMALL, "test_small is a smoke test of S1, which has smoke='x' already"),
        (
            WHOLE.replace("§1", '§1", smoke=None, because="x') + SMALL,
            "test_small is a smoke test of S1, which has smoke=None already",
        ),
        (WHOLE + SMALL.replace('"right", ', ""), "The smoke test test_small lacks S1[right]. Give it all parameters"),
        (
            WHOLE + SMALL.replace('["right",', '["right", "broken",'),
            "The smoke test test_small judges S1[broken], which its claim does not have, or marks with without_smoke.",
        ),
        (
            WHOLE + SMALL.replace('["right",', '["right", "coin",'),
            "The smoke test test_small judges S1[coin], which its claim does not have, or marks with without_smoke.",
        ),
        (WHOLE + SMALL.replace("test_", "check_"), "the function check_small has @claim(...), and pytest collects no"),
        (
            WHOLE + "import functools\ntest_it = functools.update_wrapper(functools.partial(test_whole), test_whole)\n"
            "del test_whole\n",
            "test_it[wrong-S1-smoke] is a claim that cannot run at a tier. Write it as a function",
        ),
        (SMALL.replace("All know a row", " "), "The smoke test of S1 lacks its says."),
        (
            SMALL.replace('says="All know a row"', "says=1"),
            "The smoke test of 'S1' has 1 as its says, which is not text",
        ),
    ],
)
def test_a_smoke_test_that_fits_no_claim_is_a_sentence(
    project: Any, sentence: Callable[[pytest.RunResult, str], None], text: str, said: str
) -> None:
    project.write(text)
    result = project.run("--claims-stored")
    assert result.ret != 0
    sentence(result, said)
    assert "passed" not in result.parseoutcomes()
