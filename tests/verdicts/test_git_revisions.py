"""Files at a git revision: read as they are, named without surprises, and never a command of the name's own."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from evoclaims.core.errors import UserError
from evoclaims.verdicts.comparison import find_revision

Git = Callable[..., str]


@pytest.fixture
def git(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Git:
    """A function that runs git in a repository of the test's own; other configuration of git's is out of reach."""
    for name in [name for name in os.environ if name.startswith("GIT_")]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("GIT_CONFIG_GLOBAL", os.devnull)
    monkeypatch.setenv("GIT_CONFIG_NOSYSTEM", "1")

    def run(*arguments: str) -> str:
        settings = ("-c", "user.name=t", "-c", "user.email=t@t", "-c", "init.defaultBranch=main")
        done = subprocess.run(["git", *settings, *arguments], cwd=tmp_path, capture_output=True, check=True, text=True)
        return done.stdout.strip()

    run("init", "--quiet")
    return run


@pytest.fixture
def folder(tmp_path: Path, git: Git) -> Path:
    """A folder within a repository, with a first commit of two files and a second one without them."""
    folder = tmp_path / "paper"
    (folder / "reference" / "smoke").mkdir(parents=True)
    (folder / "verdicts.toml").write_bytes(b"first\r\n\xff")
    (folder / "reference" / "smoke" / "a ü\n.jsonl").write_bytes(b"trials")
    (tmp_path / "verdicts.toml").write_text("of another folder")
    git("add", ".")
    git("commit", "--quiet", "-m", "first")
    git("tag", "v1")
    git("rm", "--quiet", "-r", "paper")
    git("commit", "--quiet", "-m", "second")
    folder.mkdir()
    return folder


@pytest.mark.parametrize("name", ["v1", "HEAD~1", "main~", "refs/tags/v1", "v1^{commit}"])
def test_files_are_read_as_the_revision_has_them(folder: Path, git: Git, name: str) -> None:
    found = find_revision(name, folder)
    assert found is not None
    assert found.sha == git("rev-parse", "v1")
    assert found.read("verdicts.toml") == b"first\r\n\xff"
    assert found.files("reference") == ("reference/smoke/a ü\n.jsonl",)
    assert found.read("reference/smoke/a ü\n.jsonl") == b"trials"
    assert list(folder.iterdir()) == []


def test_what_a_revision_does_not_have_is_none(folder: Path) -> None:
    found = find_revision("HEAD", folder)
    assert found is not None
    assert found.read("verdicts.toml") is None
    assert found.files("reference") == ()


@pytest.mark.parametrize(
    "name", ["", "v2", "HEAD~9", "v1:verdicts.toml", "--all", "-h", "--output=x", "v1 HEAD", "$(touch x)", "\0", "./v1"]
)
def test_a_name_that_means_no_revision_is_none_and_does_nothing(
    folder: Path, git: Git, tmp_path: Path, name: str
) -> None:
    before = sorted(tmp_path.rglob("*"))
    assert find_revision(name, folder) is None
    assert sorted(path for path in tmp_path.rglob("*") if ".git" not in path.parts) == sorted(
        path for path in before if ".git" not in path.parts
    )


def test_a_branch_whose_name_begins_with_a_dash_is_a_revision_and_no_option(folder: Path, git: Git) -> None:
    git("update-ref", "refs/heads/--all", "v1")
    found = find_revision("refs/heads/--all", folder)
    assert found is not None
    found = find_revision("--all", folder)
    assert found is not None
    assert found.read("verdicts.toml") == b"first\r\n\xff"


def test_no_filter_of_the_repository_is_run_on_what_is_read(folder: Path, git: Git, tmp_path: Path) -> None:
    (tmp_path / ".gitattributes").write_text("*.toml filter=f diff=f\n")
    for setting in ("filter.f.smudge", "filter.f.clean", "diff.f.textconv", "core.fsmonitor"):
        git("config", setting, f"touch {tmp_path}/ran;")
    found = find_revision("v1", folder)
    assert found is not None
    assert found.read("verdicts.toml") == b"first\r\n\xff"
    assert not (tmp_path / "ran").exists()


def test_outside_of_a_repository_there_are_no_revisions(
    tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(elsewhere.parent))
    with pytest.raises(UserError, match="is not in a git repository"):
        find_revision("HEAD", elsewhere)


def test_before_the_first_commit_no_name_means_a_revision(tmp_path: Path, git: Git) -> None:
    assert find_revision("HEAD", tmp_path) is None


def test_without_git_the_reason_is_a_sentence(tmp_path: Path, git: Git, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(UserError, match="Revisions are read by git, which does not start: No such file"):
        find_revision("HEAD", tmp_path)


def test_a_git_that_does_not_answer_is_given_up(tmp_path: Path, git: Git, monkeypatch: pytest.MonkeyPatch) -> None:
    slow = tmp_path / "bin" / "git"
    slow.parent.mkdir()
    slow.write_text("#!/bin/sh\nsleep 60\n")
    slow.chmod(0o755)
    monkeypatch.setenv("PATH", f"{slow.parent}:{os.environ['PATH']}")
    monkeypatch.setattr("evoclaims.verdicts.comparison.GIT_SECONDS", 0.2)
    with pytest.raises(UserError, match="git gave no answer within 0.2 seconds"):
        find_revision("HEAD", tmp_path)


def test_a_damaged_repository_is_a_sentence(folder: Path, git: Git, tmp_path: Path) -> None:
    found = find_revision("v1", folder)
    assert found is not None
    blob = git("rev-parse", "v1:paper/verdicts.toml")
    (tmp_path / ".git" / "objects" / blob[:2] / blob[2:]).unlink()
    with pytest.raises(UserError, match=r"git cannot read the revision v1: fatal: .*verdicts\.toml") as caught:
        found.read("verdicts.toml")
    assert "\n" not in str(caught.value)
