"""Stores merge, are shared by processes, and refuse a bad folder or disk with one sentence."""

from __future__ import annotations

import errno
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evoclaims.core.errors import UserError
from evoclaims.trials.result import TrialResult
from evoclaims.trials.result_codec import dump
from evoclaims.trials.store import DamagedFileError, Store

pytestmark = pytest.mark.oldest

Make = Callable[..., TrialResult]


@settings(max_examples=30, deadline=None)
@given(st.sets(st.integers(0, 5)), st.sets(st.integers(0, 5)))
def test_a_store_copied_over_another_holds_the_trials_of_both(
    make_result: Make, ours: set[int], theirs: set[int]
) -> None:
    with tempfile.TemporaryDirectory() as folder:
        one, two = Store(Path(folder, "one")), Store(Path(folder, "two"))
        for store, seeds in ((one, ours), (two, theirs)):
            store.check_writable()
            for seed in seeds:
                store.put(make_result(seed), {"w": np.full(2, seed)})
        shutil.copytree(two.root, one.root, dirs_exist_ok=True)
        errors: list[DamagedFileError] = []
        assert {result.seed for result in one.results(errors)} == ours | theirs
        assert errors == []
        for seed in ours | theirs:
            assert one.champion_of(one.get(make_result(seed).id))["w"][0] == seed


def test_processes_that_put_the_same_trials_at_once_leave_a_sound_store(store: Store, make_result: Make) -> None:
    script = (
        "import json, sys; import numpy as np; from pathlib import Path\n"
        "from evoclaims.trials.store import Store; from evoclaims.trials.result_codec import parse\n"
        "store = Store(Path(sys.argv[1])); sys.stdin.readline()\n"
        "texts = json.loads(sys.argv[2])\n"
        "print([store.put(parse(text), {'w': np.arange(1000.0)}) for text in texts])\n"
    )
    results = [make_result(seed) for seed in range(25)]
    texts = json.dumps([dump(result).decode() for result in results])
    command = [sys.executable, "-c", script, str(store.root), texts]
    pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    processes = [subprocess.Popen(command, env=environment, text=True, **pipes) for _ in range(2)]
    for process in processes:
        assert process.stdin is not None
        process.stdin.write("go\n")
        process.stdin.flush()
    for process in processes:
        out, err = process.communicate(timeout=120)
        assert process.returncode == 0, err
        assert "differs" not in out
    errors: list[DamagedFileError] = []
    assert {result.id for result in store.results(errors)} == {result.id for result in results}
    assert errors == []
    for result in results:
        assert store.champion_of(store.get(result.id))["w"].shape == (1000,)
    assert not list(store.root.rglob("*.tmp"))


def test_a_root_that_is_a_file_is_one_sentence_that_names_the_remedy(tmp_path: Path) -> None:
    root = tmp_path / "store"
    root.write_text("not a folder")
    with pytest.raises(UserError, match="is a file, not a folder.*--claims-storage"):
        Store(root).check_writable()


def test_a_root_below_a_file_is_a_user_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("not a folder")
    with pytest.raises(UserError, match="--claims-storage"):
        Store(tmp_path / "file" / "store").check_writable()


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
