"""A changed library is told by the next plain run on a full store, and by nothing else: libraries, stores are real."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
from changed_library import CHANGES, Change, install_changed, next_version
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
    assert "5 deselected" in ran.stdout, ran.stdout + ran.stderr
    assert len(Store(folder / ".evoclaims").ids()) == 5 * N
    return folder


def _records(folder: Path) -> dict[str, bytes]:
    """Return the records of the project's store by file name."""
    return {path.name: path.read_bytes() for path in Store(folder / ".evoclaims").record_paths()}


def test_an_unchanged_environment_runs_nothing_again(full: Path) -> None:
    before = _records(full)
    ran = _run(full)
    assert _records(full) == before
    assert "versions changed" not in ran.stdout
    assert "versions are mixed" not in ran.stdout
    assert "compiling" not in ran.stdout


@pytest.mark.parametrize("change", CHANGES, ids=lambda change: change.package)
def test_a_changed_constant_of_a_library_is_told_with_its_name_and_nothing_else_runs_again(
    full: Path, tmp_path: Path, change: Change
) -> None:
    folder, site = tmp_path / "laboratory", tmp_path / "site"
    shutil.copytree(full, folder, ignore=shutil.ignore_patterns("__pycache__"))
    install_changed(change, site)
    before = _records(folder)

    ran = _run(folder, site=site)

    old, new = version(change.package), next_version(change.package)
    told = ran.stdout.partition("versions changed: ")[2]
    assert told.startswith(f"{change.package} {old} -> {new}\n"), ran.stdout + ran.stderr
    (changed,) = re.findall(rf"\n  {change.condition} \(smoke\): {N} trials run again, (\d+) of {N} not the same", told)
    assert int(changed) > 0
    assert set(re.findall(r"(\w+ on \w+): compiling", ran.stdout)) <= {change.condition}
    after = _records(folder)
    assert before.items() <= after.items()
    assert len(after) == len(before) + N
    if change.package == "evosax":  # a change that no trial survives
        assert f"DRIFT in {change.condition} (smoke): mean_success is lower now: median 1 -> 0." in told
        assert f"verdict changed: L1[cma_es_on_parity] (smoke): supported -> refuted ({change.package} {old} ->" in told
        assert ran.returncode == 1
