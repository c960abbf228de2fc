"""Tiers are markers, and the full tier is only run when it is asked for by name."""

from __future__ import annotations

from collections.abc import Callable
from textwrap import indent
from typing import Any

import pytest
from tiny_project import PYPROJECT

Sentence = Callable[[pytest.RunResult, str], None]


@pytest.fixture
def collected(project: Any) -> Callable[..., list[str]]:
    """A function that returns what a selection leaves of two claims and a plain test, tier first."""
    project.write(a="supported", b="refuted")
    with (project.path / "claims" / "test_claims.py").open("a") as file:
        file.write("\ndef test_plain():\n    pass\n")

    def run(*arguments: str) -> list[str]:
        result = project.run("--collect-only", "-q", *arguments)
        names = [line.partition("::test_")[2].removesuffix("]") for line in result.outlines if "::" in line]
        return sorted(name.replace(f"[{name[0]}-", " ") for name in names)

    return run


@pytest.mark.parametrize(
    ("arguments", "left"),
    [
        ((), ["a smoke", "b smoke", "plain"]),
        (("-m", "smoke"), ["a smoke", "b smoke"]),
        (("-m", "full"), ["a full", "b full"]),
        (("-m", "not smoke"), ["plain"]),
        (("-m", "not full"), ["a smoke", "b smoke", "plain"]),
        (("-m", "smoke or full"), ["a full", "a smoke", "b full", "b smoke"]),
        (("-m", "full and not smoke"), ["a full", "b full"]),
        (("--claims-only", "b"), ["b smoke", "plain"]),
        (("--claims-only", "b, a"), ["a smoke", "b smoke", "plain"]),
        (("--claims-only", "b", "-m", "full"), ["b full"]),
        (("-k", "full"), []),
        (("-m", "claim and not full"), ["a smoke", "b smoke"]),
    ],
)
def test_a_selection_leaves_the_claims_of_the_tiers_it_names(
    collected: Any, arguments: tuple[str, ...], left: list[str]
) -> None:
    assert collected(*arguments) == left


def test_one_case_of_a_claim_is_selected_by_its_name(project: Any, sentence: Sentence) -> None:
    project.write(
        "@says('a')\n@pytest.mark.parametrize('case', ['x,y', 'y'])\ndef test_a(case, trials, verdict):\n    pass\n"
    )
    for case in ("x,y", "y"):
        chosen = project.run("--collect-only", "-q", f"--claims-only=a[{case}]")
        assert [line for line in chosen.outlines if "::" in line] == [f"claims/test_claims.py::test_a[{case}-a-smoke]"]
    sentence(
        project.run("--claims-only=a[z]"), "There is no claim named 'a[z]'. Did you mean 'a[y]'? Known: a[x,y], a[y]."
    )
    project.write(a="supported")
    sentence(project.run("--claims-only=a[x]"), "There is no claim named 'a[x]'. Known: a.")


def test_naming_the_test_itself_does_not_start_the_full_tier(project: Any) -> None:
    project.write(a="supported")
    result = project.run("--collect-only", "-q", "claims/test_claims.py::test_a[a-full]")
    assert result.ret == pytest.ExitCode.NO_TESTS_COLLECTED


BY_ID = """
@pytest.mark.parametrize("method", ["right", "wrong"])
@says("G9")
def test_progress(trials, verdict, method):
    verdict(trials(method, on="parity").solves_every_level.in_most_trials())

@says("G10/ü [b]")
def test_size(trials, verdict):
    verdict(trials("right", on="parity").solves_every_level.in_most_trials())
"""


def test_tests_are_chosen_by_the_ids_of_claims_which_are_parts_of_their_names(project: Any) -> None:
    project.write(BY_ID)
    shown = project.run("--collect-only", "-q", "-k", "G9").outlines
    names = [f"claims/test_claims.py::test_progress[{case}-G9-smoke]" for case in ("right", "wrong")]
    assert [line for line in shown if "::" in line] == names
    (odd,) = (line for line in project.run("--collect-only", "-q", "-k", "G10").outlines if "::" in line)
    assert odd == "claims/test_claims.py::test_size[G10_b_-smoke]"
    reports = project.json("-k", "G9 and right or G10")["claims"]
    assert [(report["claim"], report["case"]) for report in reports] == [("G9", "right"), ("G10/ü [b]", "")]
    assert project.run(odd).ret == 0


@pytest.mark.parametrize(
    ("arguments", "asked"),
    [
        (("-k", "G11"), "-k G11"),
        (("-m", "xfail"), "-m xfail"),
        (("-m", "full and smoke"), "-m 'full and smoke'"),
        (("-m", "smoke", "-k", "G11"), "-m smoke with -k G11"),
    ],
)
def test_a_selection_that_finds_nothing_says_what_was_asked_and_how_claims_are_selected(
    project: Any, arguments: tuple[str, ...], asked: str
) -> None:
    project.write(a="supported", G10="supported", G9="supported")
    result = project.run(*arguments)
    assert result.ret == pytest.ExitCode.NO_TESTS_COLLECTED
    result.stdout.fnmatch_lines(
        [
            f"No claim was selected by {asked}: --claims-only=G9 selects claims by their ids, -m smoke and -m full "
            "their tier. Claims here: G9, G10, a."
        ]
    )
    project.write("def test_it():\n    pass\n")
    assert "--claims-only" not in project.run("-k", "nothing").stdout.str()


def test_the_full_tier_judges_the_papers_own_sentence(project: Any) -> None:
    project.write(a="supported")
    result = project.run("-m", "full")
    assert result.ret == 0
    result.stdout.fnmatch_lines(["a *a at full size (§1)*✓ supported*"])


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("--claims-only", "G1"), "There is no claim named 'G1'. Known: first, second."),
        (("--claims-only", "first,secnd"), "no claim named 'secnd'. Did you mean 'second'? Known: first, second."),
    ],
)
def test_an_unknown_name_ends_the_run_with_a_sentence_before_any_trial(
    project: Any, sentence: Sentence, arguments: tuple[str, ...], text: str
) -> None:
    project.write(first="supported", second="supported")
    result = project.run(*arguments, own_store=True)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    sentence(result, text)
    assert not (project.path / ".evoclaims" / "trials").exists()


def test_parameters_multiply_with_tiers_and_name_the_case(project: Any) -> None:
    project.write(
        "@pytest.mark.parametrize('method', ['right', 'wrong'])\n@pytest.mark.parametrize('value', [1.0, 0.0])\n"
        "@says('a')\ndef test_a(trials, verdict, method, value):\n"
        "    verdict(trials(method, on='parity').success_everywhere_is(value).in_every_trial())\n"
    )
    reports = {f"{r['claim']}[{r['case']}]": r["outcome"] for r in project.json()["claims"]}
    assert reports == {
        "a[1.0-right]": "supported",
        "a[1.0-wrong]": "refuted",
        "a[0.0-right]": "refuted",
        "a[0.0-wrong]": "supported",
    }


def test_the_fixtures_are_refused_to_tests_that_are_no_claims(project: Any) -> None:
    project.write("def test_a(trials):\n    pass\n")
    result = project.run()
    assert result.ret == pytest.ExitCode.TESTS_FAILED
    result.stdout.fnmatch_lines(["*UserError: The fixtures `trials` and `verdict` are for tests marked with @claim*"])


CHECK = "@says('a')\ndef check_a(trials, verdict):\n    pass\n"
TWO = "@says('a')\ndef test_it(trials, verdict):\n    pass\n\n@says('b')\ndef test_it(trials, verdict):\n    pass\n"
JUDGES = "verdict(trials('right', on='parity').solves_every_level.in_most_trials())"
CLASS = f"""
class Stones:
    @says("a")
    def test_a(self, trials, verdict):
        {JUDGES}
"""


MADE = CLASS.replace("class Stones:", "class TestStones:\n    def __init__(self):\n        self.stones = 7\n")
DATA = f"from dataclasses import dataclass\n\n@dataclass{CLASS.replace('Stones:', 'TestStones:    # of what is set')}"
HEIR = CLASS + "    def __new__(cls):\n        return object.__new__(cls)\n\nclass TestStones(Stones):\n    pass\n"
ABSTRACT = f"""
import abc
{CLASS.replace("Stones:", "TestStones(abc.ABC):")}
    import abc

    @abc.abstractmethod
    def stones(self): ...
"""
AGAIN = "\n@says('a')\ndef test_a(trials, verdict):\n    pass\n\ndef test_a():\n    pass\n"
CLASS_AGAIN = CLASS.replace("Stones", "TestStones") + "\nclass TestStones:\n    pass\n"
MARKED = f"\n@says('a')\nclass Stones:\n    def test_a(self, trials, verdict):\n        {JUDGES}\n"
MARKED_AGAIN = MARKED.replace("Stones", "TestStones") + "\nclass TestStones:\n    pass\n"
LAMBDA = "test_a = says('a')(lambda trials, verdict: None)\n"
PARTIAL = "import functools\ntest_a = says('a')(functools.partial(print))\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (MADE, "the class TestStones has @claim(...), and pytest collects no class with __init__, so"),
        (DATA, "the class TestStones has @claim(...), and pytest collects no class with __init__, so"),
        (HEIR, "the class TestStones has @claim(...), and pytest collects no class with __new__, so"),
        (ABSTRACT, "the class TestStones has @claim(...), and pytest collects no abstract class, so"),
        (AGAIN, "the name of the test of a, or of its class, is given again below, so that it would never be judged"),
        (CLASS_AGAIN, "the name of the test of a, or of its class, is given again below, so that it would never be"),
        (MARKED, "the class Stones has @claim(...), and pytest collects no class of this name, so that"),
        (MARKED_AGAIN, "the name of the test of a, or of its class, is given again below, so that it would never be"),
        (
            LAMBDA,
            "which is no function that pytest can both mark and collect, so that it would never be judged. Write it",
        ),
        (PARTIAL, "@claim('a', ...) is above functools.partial(<built-in function print>), which is no function that"),
        (CHECK, "the function check_a has @claim(...), and pytest collects no function of this name, so that"),
        (TWO, "The tests of the claims a and b have one name, test_it, so that the second replaces the first"),
        (CLASS, "the class Stones has @claim(...), and pytest collects no class of this name, so that"),
    ],
)
def test_a_claim_that_would_not_be_collected_is_a_sentence(
    project: Any, sentence: Sentence, text: str, said: str
) -> None:
    for shown in (text, f"class TestThem:\n{indent(text, '    ')}"):
        project.write(f"{shown}\ndef test_other():\n    pass\n")
        result = project.run()
        assert result.ret == pytest.ExitCode.INTERRUPTED
        sentence(result, said)
    if text == CHECK:
        (project.path / "pyproject.toml").write_text(PYPROJECT + 'python_functions = "check"\n')
        assert "a" in {report["claim"] for report in project.json()["claims"]}


@pytest.mark.parametrize(
    "text", [f"{CLASS}    __test__ = True\n", CHECK.replace("pass", JUDGES) + "check_a.__test__ = True\n"]
)
def test_a_claim_is_collected_under_any_name_that_is_marked_for_pytest(project: Any, text: str) -> None:
    project.write(text)
    assert [report["outcome"] for report in project.json()["claims"]] == ["supported"]


def test_a_file_of_another_name_may_have_functions_that_make_claims(project: Any) -> None:
    (project.path / "claims" / "making.py").write_text(
        "from evoclaims import claim\n\ndef make(name):\n    @claim(name, says='x', where='y', smoke='z')\n"
        f"    def test(trials, verdict):\n        {JUDGES}\n    return test\n"
    )
    project.write("from making import make\n\ntest_a = make('a')\n")
    assert [report["claim"] for report in project.json()["claims"]] == ["a"]


def test_claims_that_functions_of_one_name_have_made_are_judged(project: Any) -> None:
    make = f"def make(name):\n    @says(name)\n    def test(trials, verdict):\n        {JUDGES}\n    return test\n"
    project.write(f"{make}\ntest_a = make('a')\n\n{make}\ntest_b = make('b')\n")
    assert [report["claim"] for report in project.json()["claims"]] == ["a", "b"]


@pytest.mark.parametrize(
    ("imported", "mark"),
    [
        ("from evoclaims import claim", "claim"),
        ("from evoclaims import claim", "claim.smoke"),
        ("from evoclaims import claim as states", "states"),
        ("import evoclaims", "evoclaims.claim"),
        ("import evoclaims as paper", "paper.claim.smoke"),
    ],
)
def test_claims_in_a_file_that_pytest_takes_for_none_of_tests_are_a_sentence(
    project: Any, sentence: Sentence, imported: str, mark: str
) -> None:
    project.write("def test_other():\n    pass\n")
    (project.path / "claims" / "more.py").write_text(f"{imported}\n\n@{mark}('a', ...)\ndef test(): ...\n")
    (project.path / "claims" / "helpers.py").write_text('"""No claim, which is made so:\n@claim(...)\n"""\n')
    result = project.run()
    assert result.ret == pytest.ExitCode.INTERRUPTED
    sentence(result, "more.py has a test with @claim(...), and pytest collects no file of this name, so that")


def test_a_claim_in_a_conftest_is_a_sentence(project: Any, sentence: Sentence) -> None:
    project.write("def test_other():\n    pass\n")
    (project.path / "claims" / "conftest.py").write_text(
        "import evoclaims\n\n@evoclaims.claim('A', says='a', where='b')\ndef test(): ...\n"
    )
    result = project.run()
    assert result.ret == pytest.ExitCode.INTERRUPTED
    sentence(result, "conftest.py has a test with @claim(...), and pytest collects no file of this name, so that")


def test_tests_without_claims_are_left_alone(project: Any) -> None:
    project.write("def test_a():\n    pass\n")
    result = project.run(own_store=True)
    assert result.ret == 0
    result.assert_outcomes(passed=1)
    result.stdout.no_fnmatch_line("*claims:*")
    assert not (project.path / ".evoclaims").exists()


@pytest.mark.parametrize(
    "text",
    [
        f"{CLASS}    __test__ = False\n",
        f"{CLASS}\nclass TestStones(Stones):\n    pass\n",
        f"{MADE}    __test__ = False\n",
        f"{ABSTRACT}\nclass TestThese(TestStones):\n    stones = None\n",
    ],
)
def test_a_class_that_is_left_out_on_purpose_or_has_an_heir_is_not_refused(project: Any, text: str) -> None:
    project.write(text)
    assert project.run().ret in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED)
