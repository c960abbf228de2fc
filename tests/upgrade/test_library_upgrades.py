"""A changed library is told by the next plain run on a full store, and by nothing else: libraries, stores are real."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
from changed_library import CHANGES, install_changed, next_version
from small_laboratory import CLAIMS, LABORATORY, PYPROJECT

from evoclaims.trials.store import Store

N = 10


def _run(folder: Path, *arguments: str, site: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run pytest as a user does, in a process of its own, with the libraries of `site` before the installed ones."""
    path = [str(site)] * (site is not None) + [entry for entry in sys.path if entry]
    return subprocess.run(
        [sys.executable, "-m", "pytest", "-m", "smoke", "-p", "no:cacheprovider", *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(path), "COLUMNS": "200"},
        capture_output=True,
        text=True,
        check=False,
    )


def _laboratory(folder: Path) -> Path:
    """Write the project."""
    (folder / "claims").mkdir(parents=True)
    (folder / "pyproject.toml").write_text(PYPROJECT)
    (folder / "laboratory.py").write_text(LABORATORY)
    (folder / "claims" / "test_claims.py").write_text(CLAIMS)
    return folder


@pytest.fixture(scope="module")
def full(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The project with a full store."""
    folder = _laboratory(tmp_path_factory.mktemp("full") / "laboratory")
    ran = _run(folder)
    assert "3 deselected" in ran.stdout, ran.stdout + ran.stderr
    assert len(Store(folder / ".evoclaims").ids()) == 3 * N
    return folder


def _records(folder: Path) -> dict[str, bytes]:
    """Return the records of the project's store by file name."""
    return {path.name: path.read_bytes() for path in Store(folder / ".evoclaims").record_paths()}


def test_changed_constants_of_libraries_are_told_with_their_names_and_nothing_else_runs_again(
    full: Path, tmp_path: Path
) -> None:
    """Two of the libraries are under one condition, whose trials are told with both."""
    folder, site = full, tmp_path / "site"
    conditions: dict[str, list[str]] = {}
    for change in CHANGES:
        install_changed(change, site)
        words = f"{change.package} {version(change.package)} -> {next_version(change.package)}"
        conditions.setdefault(change.condition, []).append(words)
    before = _records(folder)

    ran = _run(folder, site=site)

    for condition, words in conditions.items():
        told = ran.stdout.partition(f"\nversions changed: {', '.join(words)}\n")[2]
        changed = re.match(rf"  {condition} \(smoke\): {N} trials run again, (\d+) of {N} not the same", told)
        assert changed, ran.stdout + ran.stderr
        assert int(changed[1]) > 0
        if condition == "cma_es on parity":  # a change that no trial survives
            assert f"DRIFT in {condition} (smoke): mean_success is lower now: median 1 -> 0." in told
    assert ran.returncode == 1
    assert ran.stdout.count("versions changed: ") == len(conditions)
    assert set(re.findall(r"(\w+ on \w+): compiling", ran.stdout)) <= set(conditions)
    after = _records(folder)
    assert before.items() <= after.items()
    assert len(after) == len(before) + N * len(conditions)
