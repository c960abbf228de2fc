"""Stores meet: what is whole and new is copied, what is there stays, and what differs is named with both files."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evoclaims.cli.merge import Merged, merge_trials
from evoclaims.core import files
from evoclaims.core.files import write_once
from evoclaims.trials.integrity import verify
from evoclaims.trials.result import TrialResult
from evoclaims.trials.store import Store

pytestmark = pytest.mark.oldest

Make = Callable[..., TrialResult]

ONES = {"w": np.ones(2)}
"""Another champion."""


@pytest.fixture
def other(tmp_path: Path, make_result: Make, parameters: dict[str, Any]) -> Store:
    """Another store, with the trials of three seeds."""
    store = Store(tmp_path / "other")
    for seed in range(3):
        store.put(make_result(seed), parameters)
    return store


def _merge(source: Store, into: Store, dry_run: bool = False) -> list[Merged]:
    return list(merge_trials(source, into, dry_run))


def _contents(store: Store) -> dict[str, bytes]:
    """Return the files of trials and champions."""
    paths = [path for path in store.root.rglob("*") if path.is_file() and path.suffix in (".json", ".npz")]
    return {str(path.relative_to(store.root)): path.read_bytes() for path in paths}


def test_trials_and_champions_are_copied_to_the_byte(store: Store, other: Store) -> None:
    assert Counter(one.fate for one in _merge(other, store)) == {"copied": 3}
    assert _contents(store) == _contents(other)
    assert verify(store, repair=False) == []

    times = {path: path.stat().st_mtime_ns for path in store.root.rglob("*")}
    assert Counter(one.fate for one in _merge(other, store)) == {"there": 3}
    assert {path: path.stat().st_mtime_ns for path in store.root.rglob("*")} == times


def test_of_two_different_records_the_existing_one_stays_and_both_are_named(
    store: Store, other: Store, make_result: Make
) -> None:
    mine = make_result(1, metrics={"last_success": 0.25}, levels={"success": (1.0, 0.25)}, champion=ONES)
    store.put(mine, ONES)
    fates = {one.path.name: one for one in _merge(other, store)}
    assert Counter(one.fate for one in fates.values()) == {"copied": 2, "differs": 1}
    (differs,) = (one for one in fates.values() if one.fate == "differs")
    home = other.record_path(mine.id)
    assert str(differs) == (
        f"{home}: another record of this trial is in {store.record_path(mine.id)} and stays: "
        "metrics (last_success 0.5 and 0.25), levels (success), champions differ; made on machines of one kind"
    )
    assert store.get(mine.id) == TrialResult(**{**vars(mine), "champion": store.get(mine.id).champion})  # type: ignore[union-attr]
    assert store.champion_of(store.get(mine.id))["w"].tolist() == [1.0, 1.0]
    assert verify(store, repair=False) == []


def test_where_two_records_were_made_is_said(store: Store, other: Store, make_result: Make) -> None:
    devices = {"platform": "gpu", "kind": "NVIDIA H200", "count": 1}
    record = make_result(0, metrics={"last_success": 0.25})
    store.put(TrialResult(**{**vars(record), "provenance": {**record.provenance, "device": devices}}), {})
    (differs,) = (one for one in _merge(other, store) if one.fate == "differs")
    assert differs.reason.endswith("differ; made on an unknown device and NVIDIA H200")


@pytest.mark.parametrize("status", ["timeout", "crashed"])
def test_a_trial_without_an_outcome_gives_way_and_never_replaces_one(
    status: str, store: Store, other: Store, make_result: Make
) -> None:
    without = make_result(0, status=status, champion={})
    store.put(without, {})
    assert Counter(one.fate for one in _merge(other, store)) == {"copied": 3}
    assert store.get(without.id).status == "done"  # type: ignore[union-attr]
    behind = Store(store.root.parent / "behind")
    behind.put(without, {})
    assert [one.fate for one in _merge(behind, store)] == ["there"]
    assert store.get(without.id).status == "done"  # type: ignore[union-attr]


@pytest.mark.parametrize("damage", ["edited record", "torn record", "torn champion"])
def test_damaged_files_are_left_out_and_named(
    damage: str, store: Store, other: Store, make_result: Make, edit_record: Any
) -> None:
    one = make_result(1)
    bad = other.champion_path(one.id) if damage == "torn champion" else other.record_path(one.id)
    said = "its digest is not that of its contents, so it was edited" if damage == "edited record" else ""
    if said:
        edit_record(bad, metrics={**one.metrics, "last_success": 1.0})
    else:
        bad.write_bytes(bad.read_bytes()[:-9])
    fates = _merge(other, store)
    assert Counter(one.fate for one in fates) == {"copied": 2, "damaged": 1}
    (damaged,) = (one for one in fates if one.fate == "damaged")
    assert damaged.path == bad
    assert f"left out: {said}" in str(damaged)
    assert len(store.ids()) == 2


def test_a_damaged_file_that_is_there_stays_for_verify_to_move(store: Store, other: Store, make_result: Make) -> None:
    _merge(other, store)
    record = store.record_path(make_result(1).id)
    record.write_bytes(b"torn")
    assert Counter(one.fate for one in _merge(other, store)) == {"there": 2, "damaged": 1}
    assert record.read_bytes() == b"torn"


KILLED = """
import os, signal, sys
from pathlib import Path
from evoclaims.trials import store as stores
from evoclaims.cli.merge import merge_trials
from evoclaims.trials.store import Store

left, write = int(sys.argv[3]), stores.write_once

def write_once(*arguments):
    global left
    left -= 1
    if left < 0:
        os.kill(os.getpid(), signal.SIGKILL)
    return write(*arguments)

stores.write_once = write_once
list(merge_trials(Store(Path(sys.argv[1])), Store(Path(sys.argv[2]))))
"""


def test_a_kill_in_the_middle_leaves_a_store_that_the_next_merge_completes(store: Store, other: Store) -> None:
    """The first file is a champion, the second its record: this kill comes between the next two."""
    command = [sys.executable, "-c", KILLED, str(other.root), str(store.root), "3"]
    assert subprocess.run(command).returncode == -signal.SIGKILL
    assert len(store.ids()) == 1
    assert {one.kind for one in verify(store, repair=False)} <= {"leftover"}
    assert Counter(one.fate for one in _merge(other, store))["copied"] == 2
    assert _contents(store) == _contents(other)


def test_a_trial_that_a_run_stores_meanwhile_is_not_overwritten(
    store: Store, other: Store, make_result: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    racing = make_result(0, metrics={"last_success": 0.25}, champion=ONES)

    def faster(self: Store, result: TrialResult, packed: bytes) -> str:
        monkeypatch.undo()
        store.put(racing, ONES)
        return store.put_packed(result, packed)

    monkeypatch.setattr(Store, "put_packed", faster)
    assert Counter(one.fate for one in _merge(other, store)) == {"copied": 2, "differs": 1}
    assert store.get(racing.id).digest == racing.digest  # type: ignore[union-attr]
    assert verify(store, repair=False) == []


def test_a_link_whose_confirmation_a_network_folder_loses_is_ours(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A server may have made the link when the client asks again and is told that the name is taken."""
    link = os.link

    def told_twice(source: Path, target: Path) -> None:
        link(source, target)
        raise FileExistsError(17, "File exists")

    monkeypatch.setattr(files.os, "link", told_twice)
    assert write_once(tmp_path / "file", b"ours") is True
    assert write_once(tmp_path / "file", b"theirs") is False
    assert (tmp_path / "file").read_bytes() == b"ours"
