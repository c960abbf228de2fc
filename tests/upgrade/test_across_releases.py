"""A planted change is found among six releases of a library: environments, installers and runs are real."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from pebble import LARGER, NEGATED, RELEASES, UNINSTALLABLE, write_project, write_wheels

from evoclaims.trials.store import Store

Run = Callable[..., "subprocess.CompletedProcess[str]"]
pytestmark = pytest.mark.slow
COMMAND = [sys.executable, "-c", "import sys; from evoclaims.cli import main; sys.exit(main())"]
STORE = ".evoclaims-releases"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The project, with the wheels of its library beside it."""
    base = tmp_path_factory.mktemp("pebbles")
    write_project(base / "project")
    write_wheels(base / "wheels")
    return base / "project"


@pytest.fixture(scope="module")
def evoclaims(folder: Path) -> Run:
    """A function that runs a command in the project, where pip knows the wheels alone."""
    path = os.pathsep.join(entry for entry in sys.path if Path(entry).name == "src")
    environment = {**os.environ, "PYTHONPATH": path, "COLUMNS": "200", "PIP_NO_INDEX": "1"}
    environment["PIP_FIND_LINKS"] = str(folder.parent / "wheels")

    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [*COMMAND, *arguments], cwd=folder, env=environment, capture_output=True, text=True, check=False
        )

    return run


def _made(folder: Path) -> dict[str, int]:
    """Return when each environment was completed, by release."""
    found = (folder / STORE / "environments").glob("*/complete.json")
    return {path.parent.name.split("_")[1].rpartition(".")[0]: path.stat().st_mtime_ns for path in found}


def test_the_release_of_a_changed_verdict_is_found_by_few_environments_round_one_that_cannot_be_installed(
    evoclaims: Run, folder: Path
) -> None:
    ran = evoclaims("bisect", "P1[pebbles]", "--package", "pebble", "--good", RELEASES[0], "--bad", RELEASES[-1])
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert f"changed after pebble {LARGER} and not later than {NEGATED}; unknown between them:" in ran.stdout
    assert f"pebble {UNINSTALLABLE}: No matching distribution found for gravel-that-nobody-has" in ran.stdout
    assert "P1[pebbles]: supported -> refuted" in ran.stdout
    assert _made(folder).keys() == {RELEASES[0], LARGER, NEGATED, RELEASES[-1]}


def test_a_table_tells_verdicts_drift_and_bits_against_the_first_release(evoclaims: Run, folder: Path) -> None:
    releases = ("1.0", LARGER, UNINSTALLABLE, NEGATED)
    ran = evoclaims("across", "--package", "pebble", *releases, "--as", "json", "--out", "across.json")
    assert ran.returncode == 1, ran.stdout + ran.stderr
    assert f"pebble {NEGATED} changes P1[pebbles]; pebble {UNINSTALLABLE} has no verdicts." in ran.stdout
    rows = json.loads((folder / "across.json").read_text())["rows"]
    found = {(row["environment"], row["claim"]): row for row in rows if not row["trouble"]}
    larger, negated = found[f"pebble {LARGER}", "P1[pebbles]"], found[f"pebble {NEGATED}", "P1[pebbles]"]
    assert (larger["outcome"], larger["drifted"], larger["bits_changed"]) == ("supported", False, 10)
    assert (negated["outcome"], negated["drifted"], negated["bits_changed"]) == ("refuted", True, 10)
    assert (negated["drift_a12"], negated["drift_median_ref"], negated["drift_median_new"]) == (0, 1, 0)
    assert negated["versions"]["pebble"] == [NEGATED]
    assert not any(found[f"pebble {release}", "P1[plain]"]["repeated"] for release in (LARGER, NEGATED))
    (trouble,) = (row["trouble"] for row in rows if row["trouble"])
    said = "No matching distribution found for gravel-that-nobody-has"
    assert trouble.removesuffix(" (from pebble)") == said  # pip's own words, which its versions end otherwise


def test_a_change_of_bits_alone_is_found_by_the_environments_and_trials_that_are_there(
    evoclaims: Run, folder: Path
) -> None:
    before, ids = _made(folder), Store(folder / STORE).ids()
    ran = evoclaims("bisect", "P1", "--package", "pebble", "--good", "1.0", "--releases", "1.0", "--bad", LARGER)
    assert f"The bits of P1 changed in pebble {LARGER}; 1.0 was still as 1.0." in ran.stdout, ran.stdout + ran.stderr
    assert "making its environment" not in ran.stdout
    assert (_made(folder), Store(folder / STORE).ids()) == (before, ids)
