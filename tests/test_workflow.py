"""The workflow files: every command in them is one that this version knows, and they can change nothing."""

from __future__ import annotations

import re
import shlex
import tomllib
from configparser import ConfigParser
from pathlib import Path

import pytest

from evoclaims.cli.arguments import parser
from evoclaims.verdicts import watch_file
from evoclaims.verdicts.transitions import parse_patterns

ROOT = Path(__file__).parents[1]
TEXT, WEEKLY, NIGHTLY, SITE = (
    (ROOT / ".github" / "workflows" / name).read_text(encoding="utf-8")
    for name in ("claims.yml", "releases.yml", "watch.yml", "site.yml")
)
COMMANDS = [shlex.split(line)[1:] for line in re.findall(r"\.tox/smoke/bin/(evoclaims .*)", TEXT)]
(ACROSS,) = (line.replace("${{ matrix.package }}", "jax") for line in re.findall(r"run: evoclaims (.*)", WEEKLY))
(TOX,) = (shlex.split(" ".join(block.split())) for block in re.findall(r"run: >-\n(.*?)\n\n", TEXT, re.DOTALL))


@pytest.mark.parametrize("arguments", COMMANDS, ids=lambda arguments: arguments[0])
def test_every_command_is_one_that_the_command_line_takes(arguments: list[str]) -> None:
    assert parser().parse_args(arguments).command == arguments[0]


def test_reports_are_written_where_they_are_uploaded_from() -> None:
    written = {arguments[0]: parser().parse_args(arguments) for arguments in COMMANDS}
    assert {"report", "export", "compare"} <= written.keys()
    assert re.findall(r"\n          path: (\S+/)\n", TEXT) == ["report/", ".evoclaims/"]
    assert {Path(options.out).parts[0] for options in written.values() if getattr(options, "out", None)} == {"report"}


def test_the_claims_are_run_by_tox_on_two_cores_with_options_that_the_plugin_takes(pytestconfig: pytest.Config) -> None:
    assert TOX[:3] == ["taskset", "--cpu-list", "0,1"]
    tox = ConfigParser(interpolation=None)
    tox.read(ROOT / "tox.ini")
    assert tox.has_section(f"testenv:{TOX[TOX.index('-e') + 1]}")
    known = pytestconfig._parser.parse_known_args(TOX[TOX.index("--") + 1 :])
    assert len(parse_patterns(known.claims_compare_fail)) == 3
    assert known.claims_json == "report/verdicts.json"
    assert known.xmlpath == "report/junit.xml"


def test_every_week_the_newest_release_of_each_library_is_compared_with_the_pinned_one() -> None:
    options = parser().parse_args(shlex.split(ACROSS))
    assert (options.command, options.package, options.form) == ("across", ["jax", "installed", "newest"], "markdown")
    assert re.search(r'\n  schedule:\n    - cron: "\d+ \d+ \* \* [0-6]"\n', WEEKLY)
    (packages,) = re.findall(r"package: \[(.*)\]", WEEKLY)
    needed = {re.split("[<>=]", line)[0] for line in _project()["dependencies"]}
    assert needed.issuperset(packages.split(", "))
    assert {"jax", "brax", "evosax", "qdax"}.issubset(packages.split(", "))


def test_the_text_of_an_issue_is_kept_where_something_changed_and_only_there() -> None:
    options = parser().parse_args(shlex.split(ACROSS))
    kept = re.findall(r"if: (.*)\n +uses: actions/upload-artifact@v4\n +with:\n.*\n +path: (\S+)\n", WEEKLY)
    assert kept == [("${{ failure() && hashFiles('issue.md') != '' }}", options.out)]


def test_every_night_new_seeds_run_and_the_nights_before_are_found_again() -> None:
    (command,) = re.findall(r"run: evoclaims (.*)", NIGHTLY)
    options = parser().parse_args(shlex.split(command.removesuffix(" $RESTART")))
    assert (options.command, options.tier, options.form, options.out) == ("watch", "smoke", "markdown", "issue.md")
    assert not options.restart
    assert re.search(r'\n  schedule:\n    - cron: "\d+ \d+ \* \* \*"\n', NIGHTLY)
    steps = re.findall(r"uses: actions/cache/(\w+)@v4\n +with:\n +path: (\S+)\n +key: (watch-)", NIGHTLY)
    assert {name: path for name, path, _ in steps} == dict.fromkeys(
        ("restore", "save"), f"reproductions/nisioti2025/{watch_file.FILE}"
    )
    kept = re.findall(r"if: (.*)\n +uses: actions/cache/save", NIGHTLY)
    assert [text.startswith("${{ always() ") for text in kept] == [True]  # a night with an alarm counts, too
    issue = re.findall(r"if: (.*)\n +uses: actions/upload-artifact@v4\n +with:\n.*\n +path: (\S+)\n", NIGHTLY)
    assert ("${{ failure() && hashFiles('issue.md') != '' }}", options.out) in issue


def test_a_person_may_begin_a_new_series_of_nights_and_no_text_of_theirs_reaches_a_shell() -> None:
    assert re.search(r"\n  workflow_dispatch:\n    inputs:\n      restart:\n.*\n        type: boolean\n", NIGHTLY)
    ((yes, no),) = re.findall(r"RESTART: \$\{\{ inputs\.restart && '(.*)' \|\| '(.*)' \}\}\n", NIGHTLY)
    (command,) = re.findall(r"run: evoclaims (.*)", NIGHTLY)
    found = [parser().parse_args(shlex.split(command.replace("$RESTART", text))).restart for text in (yes, no)]
    assert found == [True, False]
    assert not [line for line in NIGHTLY.splitlines() if "${{" in line and "run:" in line]


@pytest.mark.parametrize("text", [TEXT, WEEKLY, NIGHTLY, SITE], ids=["claims", "releases", "watch", "site"])
def test_the_workflow_reads_and_changes_nothing_and_knows_no_secret(text: str) -> None:
    assert re.search(r"\npermissions:\n  contents: read\n\n", text)
    assert text.count("permissions:") == 1
    assert "secrets." not in text
    assert "pull_request_target" not in text
    assert "evoclaims accept" not in text


@pytest.mark.parametrize(("text", "count"), [(TEXT, 5), (WEEKLY, 3), (NIGHTLY, 6), (SITE, 3)])
def test_every_action_is_held_to_a_major_version(text: str, count: int) -> None:
    actions = re.findall(r"uses: (\S+)", text)
    assert len(actions) == count
    assert all(re.fullmatch(r"actions/[a-z/-]+@v\d+", action) for action in actions)


def test_the_site_is_built_where_it_is_kept_and_its_packages_are_pinned() -> None:
    tox = ConfigParser(interpolation=None)
    tox.read(ROOT / "tox.ini")
    (environment,) = re.findall(r"run: tox run -e (\w+)\n", SITE)
    command = tox[f"testenv:{environment}"]["commands"]
    assert "--strict" in command
    assert "--quiet" not in command  # which would keep warnings from being counted
    config = ROOT / "docs" / "site" / "mkdocs.yml"
    (folder,) = re.findall(r"^site_dir: (.*)$", config.read_text(encoding="utf-8"), re.MULTILINE)
    assert (config.parent / folder).resolve() == ROOT / "build" / "site"
    assert re.findall(r"\n          path: (\S+/)\n", SITE) == ["build/site/"]
    needed = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["dependency-groups"]["docs"]
    for pins in (ROOT / "constraints").glob("python?.??.txt"):
        pinned = {line.partition("==")[0] for line in pins.read_text(encoding="utf-8").splitlines()}
        assert pinned.issuperset(re.split(r"[\[<>=]", line)[0] for line in needed)


def test_every_supported_python_is_run_with_constraints_of_its_own() -> None:
    supported = re.findall(r"Python :: (3\.\d+)", " ".join(_project()["classifiers"]))
    (matrix,) = re.findall(r"python: \[(.*)\]", TEXT)
    assert re.findall(r'"(3\.\d+)"', matrix) == supported
    constraints = (path.stem for path in (ROOT / "constraints").glob("python?.??.txt"))
    assert sorted(stem.removeprefix("python") for stem in constraints) == supported
    assert f'python-version: "{supported[-1]}"' in WEEKLY
    assert WEEKLY.count(f"constraints/python{supported[-1]}.txt") == 2


def _project() -> dict[str, list[str]]:
    """Return what pyproject.toml says of the package."""
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
