"""What pytest itself says of a claim's test, by marks, fixtures and sub-tests, neither hides nor doubles a verdict."""

from __future__ import annotations

import json
from typing import Any

import pytest

from evoclaims.cli import main

SUPPORTED = "verdict(trials('right', on='parity').solves_every_level.in_most_trials())"
REFUTED = "verdict(trials('wrong', on='parity').solves_every_level.in_most_trials())"


def _outcomes(project: Any) -> list[str]:
    return [report["outcome"] for report in json.loads((project.path / "out.json").read_text())["claims"]]


@pytest.mark.parametrize("workers", [(), ("-n1",)])
def test_a_refutation_is_not_accepted_by_a_mark_of_xfail(project: Any, workers: tuple[str, ...]) -> None:
    project.write(f"@pytest.mark.xfail\n@says('a')\ndef test_a(trials, verdict):\n    {REFUTED}\n")
    result = project.run("--claims-json=out.json", *workers)
    assert (result.ret, _outcomes(project)) == (1, ["refuted"])
    assert "xfailed" not in result.parseoutcomes()


def test_a_supported_claim_that_a_strict_xfail_expects_to_fail_fails_in_pytests_words(project: Any) -> None:
    project.write(f"@pytest.mark.xfail(strict=True)\n@says('a')\ndef test_a(trials, verdict):\n    {SUPPORTED}\n")
    result = project.run("--claims-json=out.json")
    assert (result.ret, _outcomes(project), result.parseoutcomes()["failed"]) == (1, ["supported"], 1)
    result.stdout.fnmatch_lines(["*XPASS(strict)*"])


@pytest.mark.parametrize("workers", [(), ("-n1",)])
@pytest.mark.parametrize(
    ("mark", "end"),
    [("", "pytest.skip('known')"), ("", "pytest.xfail('known')"), ("@pytest.mark.xfail\n", "raise OSError('known')")],
)
def test_what_ends_a_test_after_its_verdict_does_not_hide_it(
    project: Any, mark: str, end: str, workers: tuple[str, ...]
) -> None:
    project.write(
        f"{mark}@says('a')\ndef test_a(trials, verdict):\n    {REFUTED}\n    {end}\n\n\n"
        f"@says('b')\ndef test_b(trials, verdict):\n    {SUPPORTED}\n"
    )
    result = project.run("--claims-json=out.json", *workers)
    assert (result.ret, _outcomes(project)) == (1, ["error", "supported"])
    assert {"skipped", "xfailed"}.isdisjoint(result.parseoutcomes())
    result.stdout.fnmatch_lines(["*known*"])


FIXTURE = f"""
@pytest.fixture
def broken():
    raise OSError('no data')

@says('a', expect='error', because='the data are lost')
def test_a(broken, trials, verdict):
    {SUPPORTED}
"""


def test_an_accepted_error_of_a_fixture_is_reported_once(project: Any, capsys: Any) -> None:
    project.write(FIXTURE)
    result = project.run("--claims-json=out.json", "--junitxml=out.xml")
    assert _outcomes(project) == ["error"]
    result.stdout.fnmatch_lines(["claims: 1 error", "*1 error (accepted) in *"])
    assert "KeyError" not in result.stdout.str()
    capsys.readouterr()
    main(["status", "--tier=smoke", f"--storage={project.store}", "--as=csv"])
    assert [line.partition(",")[0] for line in capsys.readouterr().out.splitlines()[1:]] == ["a"]


SUBTESTS = f"""
@says('a')
def test_a(subtests, trials, verdict):
    with subtests.test('part'):
        assert PART
    {SUPPORTED}
"""


@pytest.mark.skipif(pytest.version_tuple < (9, 0), reason="pytest 9 has subtests")
@pytest.mark.parametrize(("part", "status"), [("True", 0), ("False", 1)])
def test_parts_of_a_claims_test_have_no_verdict_of_their_own(project: Any, part: str, status: int) -> None:
    project.write(SUBTESTS.replace("PART", part))
    result = project.run("--claims-json=out.json")
    assert (result.ret, _outcomes(project)) == (status, ["supported"])
