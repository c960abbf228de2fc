"""A store says that it is one; what does not is left alone."""

from __future__ import annotations

import errno
import json
import os
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


def test_the_first_file_of_a_store_comes_with_its_mark_and_is_kept_from_git(store: Store, trial: TrialResult) -> None:
    assert json.loads((store.root / MARK).read_text()) == {
        "program": "evoclaims",
        "schema": 1,
        "content": "trials of claims; see `evoclaims --help`",
    }
    assert (store.root / ".gitignore").read_text() == "*\n"
    store.check()


@pytest.mark.parametrize(
    "name",
    [
        "notes.txt",
        "src/program.py",
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


@pytest.mark.parametrize(
    ("text", "said"),
    [
        *((text, "written by evoclaims") for text in ("", "[]", "\x00", '{"program": "another"}', "[" * 100_000)),
        ('{"program": "evoclaims", "schema": 2}', "has schema 2"),
    ],
)
def test_a_mark_of_another_program_or_a_later_release_is_none(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / MARK).write_text(text)
    with pytest.raises(UserError, match=said):
        check_store(tmp_path)


def test_a_root_that_can_be_no_folder_is_one_sentence_that_names_the_remedy(tmp_path: Path) -> None:
    (tmp_path / "circle").symlink_to("circle")
    (tmp_path / "file").write_text("not a folder")
    for name, said in (("x" * 300, ""), ("circle", ""), ("file", "is a file, not a folder.*")):
        with pytest.raises(UserError, match=f"{said}--claims-storage"):
            Store(tmp_path / name).check_writable()


def test_a_store_that_may_not_be_read_is_a_sentence(
    store: Store, trial: TrialResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(path: Any) -> list[str]:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(os, "listdir", refuse)
    with pytest.raises(UserError, match="cannot be read: Permission denied"):
        store.check()


@pytest.mark.parametrize("code", [errno.EROFS, errno.ENOSPC, errno.EACCES])
def test_a_read_only_or_full_disk_is_found_at_the_start(
    store: Store, monkeypatch: pytest.MonkeyPatch, code: int
) -> None:
    store.check_writable()

    def refuse(*arguments: Any, **options: Any) -> None:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(os, "replace", refuse)
    if code == errno.EROFS:  # a read-only disk refuses to remove even a file that is not there
        monkeypatch.setattr(Path, "unlink", refuse)
    with pytest.raises(UserError, match=f"{os.strerror(code)}.*--claims-storage"):
        store.check_writable()


def test_a_disk_that_fills_up_leaves_no_record_of_the_trial(
    store: Store, make_result: Make, parameters: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(UserError, match="No space left"):
        store.put(make_result(), parameters)
    assert store.ids() == ()
    assert not [path for path in store.root.rglob("*") if path.is_file()]
