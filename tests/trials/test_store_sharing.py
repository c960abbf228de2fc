"""Stores merge, are shared by processes, and refuse a bad folder or disk with one sentence."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from evoclaims.core.errors import UserError
from evoclaims.trials.result import TrialResult
from evoclaims.trials.store import Store

pytestmark = pytest.mark.oldest

Make = Callable[..., TrialResult]


def test_a_root_that_is_a_file_is_one_sentence_that_names_the_remedy(tmp_path: Path) -> None:
    root = tmp_path / "store"
    root.write_text("not a folder")
    with pytest.raises(UserError, match="is a file, not a folder.*--claims-storage"):
        Store(root).check_writable()


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


def test_the_writable_check_leaves_the_mark_of_a_store_alone(store: Store) -> None:
    store.check_writable()
    assert sorted(path.name for path in store.root.iterdir()) == [".gitignore", "store.json"]


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
