"""A store says that it is one; what does not, and could not have been one before stores said so, is left alone."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from evoclaims.core.errors import UserError
from evoclaims.trials.integrity import verify
from evoclaims.trials.result import TrialResult
from evoclaims.trials.store import Store
from evoclaims.trials.store_files import MARK, check_store, mark

pytestmark = pytest.mark.oldest

Make = Callable[..., TrialResult]


def contents(folder: Path) -> dict[str, bytes | None]:
    """Return every file below a folder with its bytes; None for a folder."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() if path.is_file() else None for path in folder.rglob("*")
    }


def older(store: Store) -> Store:
    """Make a store one that was written before stores were marked."""
    (store.root / MARK).unlink()
    (store.root / ".gitignore").unlink()
    return store


def test_the_first_file_of_a_store_comes_with_its_mark_and_is_kept_from_git(store: Store, trial: TrialResult) -> None:
    assert json.loads((store.root / MARK).read_text()) == {
        "program": "evoclaims",
        "schema": 1,
        "content": "trials of claims; see `evoclaims --help`",
    }
    assert (store.root / ".gitignore").read_text() == "*\n"
    store.check()


def test_a_store_older_than_the_mark_is_read_and_marked_by_the_next_trial(
    store: Store, trial: TrialResult, make_result: Make
) -> None:
    older(store)
    for folder, name in (
        ("checkpoints", "a" * 64 + "-" + "b" * 16 + ".npz"),
        ("running", "c" * 64 + ".json"),
        ("verdicts", "smoke"),
        ("quarantine", "anything at all"),
    ):
        (store.root / folder).mkdir()
        (store.root / folder / name).touch()
    store.check()
    assert store.get(trial.id) is not None
    store.put(make_result(seed=1), {})
    assert (store.root / MARK).exists()
    assert not (store.root / ".gitignore").exists()  # somebody may have committed it
    store.check()


@pytest.mark.parametrize(
    "name",
    [
        "notes.txt",
        "src/program.py",
        "trials/notes.txt",
        "champions/2024/photo.jpg",
        "checkpoints/model.npz",
        "running/shoes.json",
        "trials",
    ],
)
def test_a_folder_that_is_no_store_is_refused_and_nothing_in_it_is_touched(tmp_path: Path, name: str) -> None:
    path = tmp_path / "home" / name
    path.parent.mkdir(parents=True)
    path.write_text("precious")
    (tmp_path / "home" / ".half.tmp").write_text("precious too")
    os.utime(tmp_path / "home" / ".half.tmp", (0, 0))
    before, store = contents(tmp_path), Store(tmp_path / "home")
    for use in (store.check, store.check_writable, lambda: verify(store, repair=True)):
        with pytest.raises(UserError, match=r"is not a trial store: it has no store\.json") as caught:
            use()
        assert name.split("/")[0] in str(caught.value)
    assert contents(tmp_path) == before


def test_an_empty_folder_and_one_that_is_not_there_may_become_stores(tmp_path: Path) -> None:
    for root in (tmp_path / "empty", tmp_path / "new"):
        (tmp_path / "empty").mkdir(exist_ok=True)
        check_store(root)
        mark(root)
        check_store(root)


@pytest.mark.parametrize("text", ["", "{}", "[]", "\x00", '{"program": "another"}', "[" * 100_000])
def test_a_mark_that_says_something_else_is_no_mark(tmp_path: Path, text: str) -> None:
    (tmp_path / MARK).write_text(text)
    with pytest.raises(UserError, match=r"is not a trial store: its store\.json was not written by evoclaims"):
        check_store(tmp_path)


def test_a_store_of_a_later_release_is_left_to_it(tmp_path: Path) -> None:
    (tmp_path / MARK).write_text('{"program": "evoclaims", "schema": 2}')
    with pytest.raises(UserError, match="has schema 2"):
        check_store(tmp_path)


def test_a_store_copied_over_another_is_one_store(store: Store, trial: TrialResult, tmp_path: Path) -> None:
    other = Store(tmp_path / "other")
    other.check_writable()
    shutil.copytree(store.root, other.root, dirs_exist_ok=True)
    other.check()
    assert other.get(trial.id) == store.get(trial.id)


def test_a_root_whose_name_is_too_long_or_leads_in_a_circle_is_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "circle").symlink_to("circle")
    for name in ("x" * 300, "circle"):
        with pytest.raises(UserError, match="--storage"):
            Store(tmp_path / name).check_writable()


def test_a_store_that_may_not_be_read_is_a_sentence(
    store: Store, trial: TrialResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(path: Any) -> list[str]:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(os, "listdir", refuse)
    with pytest.raises(UserError, match="cannot be read: Permission denied"):
        store.check()
