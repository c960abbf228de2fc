"""The workflow file: every command in it is one that this version knows, and it can change nothing."""

from __future__ import annotations

import re
import shlex
from configparser import ConfigParser
from pathlib import Path

import pytest

from evoclaims.cli.main import _parser
from evoclaims.verdicts.transitions import parse_patterns

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / ".github" / "workflows" / "claims.yml").read_text(encoding="utf-8")
COMMANDS = [shlex.split(line)[1:] for line in re.findall(r"\.tox/smoke/bin/(evoclaims .*)", TEXT)]
(TOX,) = (shlex.split(" ".join(block.split())) for block in re.findall(r"run: >-\n(.*?)\n\n", TEXT, re.DOTALL))


@pytest.mark.parametrize("arguments", COMMANDS, ids=lambda arguments: arguments[0])
def test_every_command_is_one_that_the_command_line_takes(arguments: list[str]) -> None:
    assert _parser().parse_args(arguments).command == arguments[0]


def test_the_report_and_the_badge_are_written_where_they_are_uploaded_from() -> None:
    written = {arguments[0]: _parser().parse_args(arguments) for arguments in COMMANDS}
    assert {"report", "badge", "export", "compare"} <= written.keys()
    assert re.findall(r"\n          path: (\S+/)\n", TEXT) == ["report/", ".evoclaims/"]
    assert {Path(options.out).parts[0] for options in written.values() if hasattr(options, "out")} == {"report"}


def test_the_claims_are_run_by_tox_on_two_cores_with_options_that_the_plugin_takes(pytestconfig: pytest.Config) -> None:
    assert TOX[:3] == ["taskset", "--cpu-list", "0,1"]
    tox = ConfigParser(interpolation=None)
    tox.read(ROOT / "tox.ini")
    assert tox.has_section(f"testenv:{TOX[TOX.index('-e') + 1]}")
    known = pytestconfig._parser.parse_known_args(TOX[TOX.index("--") + 1 :])
    assert len(parse_patterns(known.claims_compare_fail)) == 2
    assert known.claims_json == "report/verdicts.json"
    assert known.xmlpath == "report/junit.xml"


def test_the_workflow_reads_and_changes_nothing_and_knows_no_secret() -> None:
    assert re.search(r"\npermissions:\n  contents: read\n\n", TEXT)
    assert TEXT.count("permissions:") == 1
    assert "secrets." not in TEXT
    assert "pull_request_target" not in TEXT
    assert "evoclaims accept" not in TEXT


def test_every_action_is_held_to_a_major_version() -> None:
    actions = re.findall(r"uses: (\S+)", TEXT)
    assert len(actions) == 5
    assert all(re.fullmatch(r"actions/[a-z-]+@v\d+", action) for action in actions)


def test_every_supported_python_is_run_with_constraints_of_its_own() -> None:
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    supported = re.findall(r"Python :: (3\.\d+)", project)
    (matrix,) = re.findall(r"python: \[(.*)\]", TEXT)
    assert re.findall(r'"(3\.\d+)"', matrix) == supported
    constraints = (path.stem for path in (ROOT / "constraints").glob("python?.??.txt"))
    assert sorted(stem.removeprefix("python") for stem in constraints) == supported
