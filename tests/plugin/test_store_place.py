"""Where a run's store is, and what becomes of a run whose store cannot be written."""

from __future__ import annotations

import builtins
import errno
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from evoclaims.cli import main
from evoclaims.trials.store import Store

Sentence = Callable[[pytest.RunResult, str], None]


@pytest.fixture
def elsewhere(project: Any, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder outside the project that is the current one."""
    project.write(a="supported")
    folder = tmp_path_factory.mktemp("elsewhere")
    monkeypatch.chdir(folder)
    return folder


def test_the_store_is_in_the_projects_root_wherever_pytest_is_called(project: Any, elsewhere: Path) -> None:
    result = project.run(str(project.path / "claims"), "-p", "no:cacheprovider", own_store=True)
    assert result.ret == 0
    assert len(Store(project.path / ".evoclaims").ids()) == 10
    assert not (elsewhere / ".evoclaims").exists()


def test_a_store_that_is_named_is_relative_to_the_current_folder(project: Any, elsewhere: Path) -> None:
    arguments = (str(project.path / "claims"), "-p", "no:cacheprovider", "--claims-storage=mine")
    assert project.run(*arguments, own_store=True).ret == 0
    assert len(Store(elsewhere / "mine").ids()) == 10
    assert not (project.path / ".evoclaims").exists()


@pytest.mark.parametrize("option", ["--claims-storage", "--claims-json"])
def test_a_path_after_a_space_that_moves_pytests_root_is_a_sentence(
    project: Any, sentence: Sentence, tmp_path_factory: pytest.TempPathFactory, option: str
) -> None:
    project.write(a="supported")
    there = tmp_path_factory.mktemp("there")
    result = project.run(option, str(there), own_store=True)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    sentence(result, f"not the project {project.path}: it")
    sentence(result, f"Write {option} with =, as in {option}=PATH.")
    project.run(option, "inside", own_store=True)
    assert project.run(option, "inside", own_store=True).ret == 0  # it exists now, and is below the project's root


def test_commands_find_the_projects_store_from_a_folder_below(
    project: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    project.write(a="supported")
    monkeypatch.chdir(project.path / "claims")
    assert main(["run", "right", "--trials=10", "--device=cpu"]) == 0
    assert len(Store(project.path / ".evoclaims").ids()) == 10
    assert main(["verify"]) == 0
    assert "10 trials in ../.evoclaims, 0 problems" in capsys.readouterr().out
    assert main(["status"]) == 0
    assert "1 supported" in capsys.readouterr().out
    assert not (project.path / "claims" / ".evoclaims").exists()


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("--claims-storage=",), "--claims-storage names no folder"),
        (("--claims-stored", "--claims-storage=mistyped"), "the folder does not exist"),
        (("--claims-storage=claims",), "is not a trial store"),
        (("--claims-stored", "--claims-storage=claims"), "is not a trial store"),
    ],
)
def test_a_folder_that_is_no_store_ends_a_run_before_it_begins(
    project: Any, sentence: Sentence, arguments: tuple[str, ...], text: str
) -> None:
    project.write(a="supported")
    before = sorted((project.path / "claims").iterdir())
    result = project.run(*arguments, own_store=True)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    sentence(result, text)
    assert [path for path in sorted((project.path / "claims").iterdir()) if path.name != "__pycache__"] == before


def test_a_fresh_clone_has_no_store_yet_and_that_is_no_mistake(project: Any) -> None:
    project.write(a="supported")
    result = project.run("--claims-stored", own_store=True)
    assert result.ret == pytest.ExitCode.NO_TESTS_COLLECTED
    assert main(["status"]) == 0
    assert main(["verify"]) == 0


@pytest.fixture
def read_only(monkeypatch: pytest.MonkeyPatch) -> Callable[[Path], None]:
    """A function that makes a folder behave as on a read-only disk, also for those who may do everything."""

    def freeze(folder: Path) -> None:
        def frozen(path: Any) -> bool:
            return isinstance(path, str | os.PathLike) and Path(path).absolute().is_relative_to(folder)

        def guard(owner: Any, name: str) -> None:
            real = getattr(owner, name)

            def guarded(path: Any, *rest: Any, **options: Any) -> Any:
                writes = name != "open" or (rest and (set("wax+") & set(str(rest[0]))))
                if writes and any(map(frozen, (path, *rest))):
                    raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))
                return real(path, *rest, **options)

            monkeypatch.setattr(owner, name, guarded)

        for name in ("mkdir", "link", "replace", "rename", "unlink", "utime"):
            guard(os, name)
        guard(builtins, "open")

    return freeze


def test_a_complete_store_on_a_read_only_disk_is_judged(project: Any, read_only: Callable[[Path], None]) -> None:
    project.write(a="supported", b="refuted")
    first = project.run(own_store=True)
    before = {path: path.stat().st_mtime_ns for path in (project.path / ".evoclaims").rglob("*")}
    read_only(project.path / ".evoclaims")
    second = project.run(own_store=True)
    assert (first.ret, second.ret) == (1, 1)
    second.stdout.fnmatch_lines(
        [
            "warning: The files of evidence could not be written. *Read-only file system*",
            "claims: 1 supported, 1 refuted",
        ]
    )
    assert {path: path.stat().st_mtime_ns for path in (project.path / ".evoclaims").rglob("*")} == before


def test_a_store_on_a_read_only_disk_that_lacks_trials_is_a_sentence(
    project: Any, sentence: Sentence, read_only: Callable[[Path], None]
) -> None:
    project.write(a="supported")
    project.run(own_store=True)
    project.write(a="supported", b="refuted")
    read_only(project.path / ".evoclaims")
    result = project.run(own_store=True)
    assert result.ret == 1
    sentence(result, "Read-only file system")
    result.stdout.fnmatch_lines(["claims: 1 supported, 1 error"])
