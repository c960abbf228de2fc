"""A skipped claim is not run, and a run that has judged none of its claims says so and does not end well."""

from __future__ import annotations

import json
from typing import Any

import pytest

BODY = "verdict(trials('right', on='parity').solves_every_level.in_most_trials())"
SKIPS = {
    "a mark": (f"@pytest.mark.skip(reason='later')\n@says('a')\ndef test_a(trials, verdict):\n    {BODY}\n", "later"),
    "a condition": (
        f"@says('a')\n@pytest.mark.skipif(True, reason='no GPU')\ndef test_a(trials, verdict):\n    {BODY}\n",
        "no GPU",
    ),
    "a call": ("@says('a')\ndef test_a(trials, verdict):\n    pytest.skip('in the middle')\n", "in the middle"),
    "an expected failure": (
        "@pytest.mark.xfail(reason='known')\n@says('a')\ndef test_a(trials, verdict):\n    assert False\n",
        "xfail: known",
    ),
}


def _reports(project: Any) -> list[dict[str, Any]]:
    plain: list[dict[str, Any]] = json.loads((project.path / "out.json").read_text())["claims"]
    return plain


@pytest.mark.parametrize("how", SKIPS)
def test_a_run_whose_every_claim_is_skipped_says_that_nothing_was_measured(project: Any, how: str) -> None:
    text, reason = SKIPS[how]
    project.write(text)
    assert project.run("--claims-undecided=fail").ret == pytest.ExitCode.TESTS_FAILED
    result = project.run("--claims-json=out.json")
    assert result.ret == pytest.ExitCode.NO_TESTS_COLLECTED
    result.stdout.fnmatch_lines(
        [
            "a *a in small (§1)*- not run*",
            f"- a: its test was skipped ({reason})",
            "claims: 1 not run",
            "No claim was judged: nothing was measured.",
        ]
    )
    (report,) = _reports(project)
    assert (report["claim"], report["tier"], report["outcome"]) == ("a", "smoke", "not run")
    assert reason in report["reason"]
    outcomes = result.parseoutcomes()
    assert outcomes.get("skipped", 0) + outcomes.get("xfailed", 0) == 1  # pytest's own counts stay what they are


def test_a_skipped_claim_beside_a_judged_one_is_listed_and_fails_nothing(project: Any) -> None:
    project.write(a="pytest.skip('later')", b="supported")
    result = project.run("--claims-json=out.json", "--claims-undecided=fail")
    assert result.ret == 0
    result.stdout.fnmatch_lines(["claims: 1 supported, 1 not run"])
    assert [report["outcome"] for report in _reports(project)] == ["not run", "supported"]


GAPS = f"""
from evoclaims import without_smoke

@claim('whole', says='whole at full size', where='§1', smoke=None, because='no small task shows it')
def test_whole(trials, verdict):
    {BODY}

@says('part')
@pytest.mark.parametrize('case', ['shown', pytest.param('hidden', marks=without_smoke(because='too slow'))])
def test_part(trials, verdict, case):
    {BODY}
"""


def test_a_claim_without_a_smoke_test_is_listed_with_the_reason_and_judged_in_full(project: Any) -> None:
    project.write(GAPS)
    result = project.run("-m", "smoke or full", "--claims-json=out.json")
    assert result.ret == 0
    result.stdout.fnmatch_lines(["2 claims have no smoke test: evoclaims status --why"])
    result.stdout.no_fnmatch_line("*too slow*")
    found = {(report["tier"], report["claim"], report["case"]): report for report in _reports(project)}
    gaps = {key: report["reason"] for key, report in found.items() if report["outcome"] == "not run"}
    assert gaps == {
        ("smoke", "whole", ""): "it has no smoke test: no small task shows it",
        ("smoke", "part", "hidden"): "it has no smoke test: too slow",
    }
    assert found["smoke", "whole", ""]["statement"] == "whole at full size"
    assert {report["outcome"] for key, report in found.items() if key not in gaps} == {"supported"}


@pytest.mark.parametrize(
    ("end", "status"),
    [("pytest.skip('too late')", pytest.ExitCode.OK), ("raise OSError('too late')", pytest.ExitCode.TESTS_FAILED)],
)
def test_a_claim_that_was_judged_is_not_judged_again_when_its_fixture_skips_or_fails_at_the_end(
    project: Any, end: str, status: int
) -> None:
    project.write(
        f"@pytest.fixture\ndef late():\n    yield\n    {end}\n\n"
        f"@says('a')\ndef test_a(late, trials, verdict):\n    {BODY}\n"
    )
    result = project.run("--claims-json=out.json")
    assert result.ret == status
    assert ("OSError: too late" in result.stdout.str()) == bool(status)
    assert [report["outcome"] for report in _reports(project)] == ["supported"]


def test_a_skipped_claim_keeps_the_verdict_that_an_earlier_run_has_stored(project: Any) -> None:
    project.write(a="supported")
    project.run(own_store=True)
    stored = project.path / ".evoclaims" / "verdicts" / "smoke" / "a.json"
    before = stored.read_bytes()
    project.write(a="pytest.skip('later')")
    project.run(own_store=True)
    assert stored.read_bytes() == before


def test_a_run_without_claims_leaves_no_old_verdicts_behind(project: Any) -> None:
    project.write("def test_plain():\n    pass\n")
    (project.path / "out.json").write_text("of an earlier run")
    assert project.run("--claims-json=out.json", "--collect-only").ret == 0
    assert (project.path / "out.json").read_text() == "of an earlier run"
    assert project.run("--claims-json=out.json").ret == 0
    assert json.loads((project.path / "out.json").read_text()) == {
        "schema": 1,
        "claims": [],
        "drift": None,
        "upgrade": None,
    }


def test_a_claim_that_a_conftest_takes_out_is_not_missing_without_a_word(project: Any, sentence: Any) -> None:
    project.write(a="supported", b="supported")
    hook = "def pytest_collection_modifyitems(config, items):\n    last = items.pop()\n"
    conftest = project.path / "conftest.py"
    conftest.write_text(hook)
    result = project.run()
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    sentence(result, "taken claims out of the run without a word: claims/test_claims.py::test_b[b-smoke]. Let it")
    conftest.write_text(f"{hook}    config.hook.pytest_deselected(items=[last])\n")
    assert project.run().ret == 0
    conftest.unlink()
    assert project.run("-k", "test_a").ret == 0
    assert project.run("--deselect=claims/test_claims.py::test_b").ret == 0


@pytest.mark.parametrize("workers", [(), ("-n1",)])
def test_a_claim_that_a_plugin_keeps_from_being_run_is_not_missing_without_a_word(
    project: Any, sentence: Any, workers: tuple[str, ...]
) -> None:
    project.write(a="supported", b="refuted")
    (project.path / "conftest.py").write_text(
        "def pytest_runtest_protocol(item):\n    return 'test_b' in item.nodeid or None\n"
    )
    result = project.run(*workers)
    assert result.ret == pytest.ExitCode.TESTS_FAILED
    sentence(
        result, "kept claims from being judged or reported, without a word: claims/test_claims.py::test_b[b-smoke]."
    )
    assert project.run("--setup-plan").ret == 0
    project.write(b="refuted")
    assert project.run(*workers).ret == pytest.ExitCode.TESTS_FAILED  # where no claim has a verdict, too


DIED = """
import pytest

def pytest_runtest_protocol(item):
    report = pytest.TestReport(item.nodeid, item.location, {}, "failed", "died by signal 9", "call")
    item.ihook.pytest_runtest_logreport(report=report)
    return True
"""


def test_a_claim_that_a_plugin_reports_as_failed_is_not_kept_without_a_word(project: Any) -> None:
    """As plugins do that run each test in a process of its own, where that dies."""
    project.write(a="supported")
    (project.path / "conftest.py").write_text(DIED)
    result = project.run()
    assert result.ret == pytest.ExitCode.TESTS_FAILED
    result.stdout.fnmatch_lines(["*died by signal 9*"])
    result.stdout.no_fnmatch_line("*without a word*")


@pytest.mark.parametrize("before", ["", "verdict(trials('wrong', on='parity').solves_every_level.in_most_trials()); "])
def test_a_run_that_a_test_ends_well_says_which_claims_have_no_verdict(
    project: Any, sentence: Any, before: str
) -> None:
    project.write(a="supported", b=f"{before}pytest.exit('enough', returncode=0)", c="refuted")
    result = project.run("--ff")  # in this order
    assert result.ret == pytest.ExitCode.TESTS_FAILED
    sentence(
        result, "before claims had verdicts: claims/test_claims.py::test_b[b-smoke], claims/test_claims.py::test_c["
    )
    assert project.run("--ff", "-k", "a-smoke").ret == 0
