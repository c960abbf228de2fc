"""`evoclaims new`: what it writes runs, from a checkout and from a wheel, and nothing is overwritten."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from evoclaims import cli

ROOT = Path(__file__).parents[2]
STARTERS = ROOT / "src" / "evoclaims" / "projects" / "starters"
LOOPS = """
from evoclaims import Budget
from reproductions.our_paper import METHODS, TASKS
from reproductions.hill_climber import hill_climber
task, budget = TASKS["majority"], Budget(generations=1_000)
for name, method in METHODS.items():
    for seed in range(10):
        metrics, policy = hill_climber(task, seed, budget, lambda *_, **__: None, **method.settings)
        right = [(policy(bits)[0] > 0) == wanted for bits, (wanted,) in zip(task.table.inputs, task.table.targets)]
        print(f"{name},{seed},{metrics['steps']},{sum(right) / 8:g}")
"""
"""Prints the trials of the starter project with a training loop, as rows of a table."""

PAGE = re.compile(r"docs/[\w.]+\.md")


def _new(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    status = cli.main(["new", *arguments])
    return status, *capsys.readouterr()


def _files(folder: Path) -> dict[str, bytes]:
    paths = (path for path in folder.rglob("*") if path.is_file() and "__pycache__" not in path.parts)
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}


def _run(folder: Path, *command: str, site: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run Python in a folder, as a user does, with the packages of `site` before the installed ones."""
    path = [str(site)] * (site is not None) + [entry for entry in sys.path if entry and Path(entry) != ROOT]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path), "COLUMNS": "160"}
    command = (sys.executable, *command)
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


def test_a_paper_is_unpacked_whole(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, said, _ = _new(capsys, str(tmp_path / "paper"), "--from", "nisioti2025")
    assert status == 0
    assert "evoclaims status --tier full" in said
    for part in ("claims", "reproductions", "docs"):
        assert _files(tmp_path / "paper" / part) == _files(ROOT / part)
    named = {page for text in _files(tmp_path / "paper" / "claims").values() for page in PAGE.findall(text.decode())}
    assert len(named) > 2
    assert all((tmp_path / "paper" / page).is_file() for page in named)
    assert "[tool.evoclaims]" in (tmp_path / "paper" / "pyproject.toml").read_text()


@pytest.mark.parametrize("kind", [pytest.param("loop", marks=pytest.mark.newest), "gymnasium", "csv"])
def test_a_starter_project_of_each_kind_passes_as_it_is(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if kind == "gymnasium":
        pytest.importorskip("gymnasium")
    folder = tmp_path / "mine"
    status, said, _ = _new(capsys, str(folder), "--with", kind)
    assert (status, f"wrote {len(_files(folder))} files to {folder}; next:" in said) == (0, True)
    assert (folder / ".gitignore").read_text().splitlines() == ["__pycache__/", ".venv/"]
    named = set(re.findall(r"[\w/]+\.(?:py|csv)\b", said.replace("docs/", "")))
    assert {Path(name).name for name in named} <= {Path(name).name for name in _files(folder)}
    ran = _run(folder, "-W", "error", "-m", "pytest", "-m", "smoke", "-p", "no:xdist", "--claims-json=out.json")
    assert ran.returncode == 0, ran.stdout + ran.stderr
    claims = json.loads((folder / "out.json").read_text())["claims"]
    assert [(one["claim"], one["outcome"], one["verdict"]["n"]) for one in claims] == [
        ("H1", "supported", 10),
        ("H2", "supported", 10),
    ]


def test_the_table_that_is_written_has_the_trials_of_the_loop_that_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for kind in ("loop", "csv"):
        assert _new(capsys, str(tmp_path / kind), "--with", kind)[0] == 0
    ran = _run(tmp_path / "loop", "-c", LOOPS)
    assert ran.returncode == 0, ran.stderr
    table = (tmp_path / "csv" / "reproductions" / "our_paper" / "runs.csv").read_text()
    assert table.splitlines() == ["method,seed,generations,success", *ran.stdout.splitlines()]


def test_nothing_is_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "claims").mkdir()
    status, _, said = _new(capsys, str(tmp_path))
    assert (status, said) == (
        2,
        f"evoclaims: {tmp_path} is not empty: claims is in it. Nothing was written; name a new folder.\n",
    )
    assert list(tmp_path.rglob("*")) == [tmp_path / "claims"]


def test_a_new_repository_is_a_place_for_a_project(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / ".git").mkdir()
    monkeypatch.chdir(tmp_path)
    status, said, _ = _new(capsys, ".")
    assert status == 0
    assert "\ncd " not in said
    assert (tmp_path / "pyproject.toml").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("mine", "--from", "nisoti"), "There is no paper named 'nisoti'. Did you mean 'nisioti2025'? Known: "),
        (
            ("mine", "--with", "gymnasum"),
            "There is no kind of starter project named 'gymnasum'. Did you mean 'gymnasium'? Known: ",
        ),
        (("file",), "Cannot write a project to file: Not a directory. Name a new folder."),
        (("file/mine",), "Cannot write a project to file/mine: Not a directory."),
    ],
)
def test_what_cannot_be_written_is_a_sentence(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    arguments: tuple[str, ...],
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    status, _, error = _new(capsys, *arguments)
    assert (status, said in error) == (2, True)


def test_a_wheel_is_enough_to_judge_the_paper_s_claims(tmp_path: Path) -> None:
    pytest.importorskip("hatchling")
    site, paper = tmp_path / "site", tmp_path / "paper"
    build = ("-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path))
    install = (
        "-m",
        "pip",
        "install",
        "--no-index",
        "--no-deps",
        "--no-compile",
        f"--find-links={tmp_path}",
        "-t",
        str(site),
        "evoclaims",
    )
    for command in (build, install):
        done = _run(ROOT, *command)
        assert done.returncode == 0, done.stdout + done.stderr
    done = _run(tmp_path, "-m", "evoclaims", "new", "paper", "--from", "nisioti2025", site=site)
    assert done.returncode == 0, done.stderr
    where = _run(paper, "-c", "import evoclaims; print(evoclaims.__file__)", site=site)
    assert Path(where.stdout.strip()).is_relative_to(site)
    assert _files(paper / "reproductions") == _files(ROOT / "reproductions")
    assert _files(site / "evoclaims" / "projects" / "starters") == _files(STARTERS)

    shown = _run(paper, "-m", "evoclaims", "status", "--tier", "full", "--only", "C2", site=site)
    assert "claims (full): controls: 2 supported" in shown.stdout
