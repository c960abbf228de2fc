"""Processes that store the same trial at the same moment: the first record stays, with its own champion."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evoclaims.core.files import write_once
from evoclaims.trials import store as stores
from evoclaims.trials.integrity import verify
from evoclaims.trials.result import TrialResult
from evoclaims.trials.store import Store

pytestmark = pytest.mark.oldest

Make = Callable[..., TrialResult]
ORDERS = sorted({"".join(order) for order in permutations("AABB")})
"""Every order in which two processes can take the two steps of storing: champion, then record."""


def _interleaved(monkeypatch: pytest.MonkeyPatch, order: str, puts: dict[str, Callable[[], str]]) -> dict[str, str]:
    """Run two puts in threads that take their steps in this order, both after neither has found a record."""
    looked, turn, turns = threading.Barrier(2), threading.Condition(), list(order)
    arrived = threading.local()

    def in_turn(path: Path, data: bytes, advice: str) -> bool:
        if not hasattr(arrived, "name"):
            arrived.name = threading.current_thread().name[-1]
            looked.wait(60)
        with turn:
            assert turn.wait_for(lambda: turns[0] == arrived.name, 60)
            wrote = write_once(path, data, advice)
            del turns[0]
            turn.notify_all()
        return wrote

    monkeypatch.setattr(stores, "write_once", in_turn)
    became: dict[str, str] = {}
    threads = [
        threading.Thread(target=lambda name=name: became.update({name: puts[name]()}), name=f"put {name}")
        for name in puts
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(120)
    return became


@pytest.mark.parametrize("order", ORDERS)
def test_the_first_record_keeps_its_own_champion_and_equal_ones_are_stored_once_in_every_order(
    store: Store, make_result: Make, parameters: dict[str, Any], monkeypatch: pytest.MonkeyPatch, order: str
) -> None:
    champions = {"A": {"w": np.zeros(3)}, "B": {"w": np.ones(3)}}
    numbers = {"A": 0.75, "B": 0.0}
    results = {
        name: make_result(metrics={"mean_success": numbers[name]}, champion=champions[name]) for name in champions
    }
    puts = {name: lambda name=name: store.put(results[name], champions[name]) for name in "AB"}  # type: ignore[misc]
    became = _interleaved(monkeypatch, order, puts)
    first = min("AB", key=order.rindex)
    assert became == {first: "stored", ("B" if first == "A" else "A"): "differs"}
    kept = store.get(results["A"].id)
    assert kept is not None
    assert kept.digest == results[first].digest
    np.testing.assert_array_equal(store.champion_of(store.get(kept.id))["w"], champions[first]["w"])
    assert len(store.champion_files(kept.id)) == 1
    assert verify(store, repair=False) == []
    assert not list(store.root.rglob("*.tmp"))
    equal = make_result(seed=1)
    puts = {name: lambda: store.put(equal, parameters) for name in "AB"}
    assert sorted(_interleaved(monkeypatch, order, puts).values()) == ["present", "stored"]
    assert store.champion_of(store.get(equal.id)).keys() == parameters.keys()
    assert verify(store, repair=False) == []


@pytest.fixture
def raced(store: Store, make_result: Make) -> TrialResult:
    """A trial whose champion lies beside the usual place, where a killed process has left another one."""
    result = make_result(champion={"w": np.ones(3)})
    store.put(result, {"w": np.zeros(3)})
    store.record_path(result.id).unlink()
    store.put(result, {"w": np.ones(3)})
    assert len(store.champion_files(result.id)) == 2
    kept = store.get(result.id)
    assert kept is not None
    return kept


def _age(*paths: Path) -> None:
    for path in paths:
        os.utime(path, (1.0, 1.0))


def test_a_champion_that_a_killed_process_left_is_a_leftover_once_settled(store: Store, raced: TrialResult) -> None:
    assert verify(store, repair=False) == []
    _age(*store.champion_files(raced.id))
    (problem,) = verify(store, repair=True)
    assert (problem.kind, problem.path) == ("leftover", store.champion_path(raced.id))
    assert "no record of its trial names it" in problem.reason
    assert store.champion_of(store.get(raced.id))["w"].tolist() == [1.0, 1.0, 1.0]


def test_a_torn_champion_beside_the_usual_place_is_named_and_a_damaged_record_takes_all_aside(
    store: Store, raced: TrialResult
) -> None:
    spare = store.champion_file(raced)
    assert spare != store.champion_path(raced.id)
    spare.write_bytes(b"torn")
    problems = {problem.path: problem.kind for problem in verify(store, repair=False)}
    assert problems == {store.record_path(raced.id): "record", spare: "champion"}
    files = store.champion_files(raced.id)
    store.record_path(raced.id).write_bytes(b"torn")
    assert {problem.path for problem in verify(store, repair=True)} == {store.record_path(raced.id), *files}
    assert store.champion_files(raced.id) == ()


@pytest.mark.parametrize("name", ["{id}.0123.npz", "{id}.0123456789abcdeg.npz", "{id}.0123456789abcdef.npy"])
def test_a_name_that_is_no_champions_is_foreign(store: Store, trial: TrialResult, name: str) -> None:
    path = store.champion_path(trial.id).with_name(name.format(id=trial.id))
    path.write_bytes(b"")
    assert [(problem.kind, problem.path) for problem in verify(store, repair=False)] == [("champion", path)]


def test_a_trial_that_ended_in_another_process_meanwhile_is_not_replaced_by_one_out_of_time(
    store: Store, make_result: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    late = make_result(status="timeout")
    store.put(replace(late, timing={**late.timing, "limit": 1.0}), {})
    mark = stores.mark

    def in_between(root: Path) -> None:
        monkeypatch.setattr(stores, "mark", mark)
        assert store.put(make_result(), {}) == "stored"
        mark(root)

    monkeypatch.setattr(stores, "mark", in_between)
    assert store.put(replace(late, timing={**late.timing, "limit": 2.0}), {}) == "differs"
    (kept,) = store.records(late.id)
    assert kept.status == "done"


@pytest.mark.parametrize("links", [True, False])
def test_a_file_written_once_stays_as_the_first_has_written_it_also_where_there_are_no_hard_links(
    tmp_path: Path, links: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*arguments: Any) -> None:
        raise PermissionError(1, "Operation not permitted")

    if not links:
        monkeypatch.setattr(os, "link", refuse)
    path = tmp_path / "folder" / "file"
    assert write_once(path, b"first") is True
    assert write_once(path, b"second") is False
    assert path.read_bytes() == b"first"
    assert list(path.parent.iterdir()) == [path]


def test_of_many_writers_at_once_exactly_one_writes(tmp_path: Path) -> None:
    start = threading.Barrier(8)

    def write(number: int) -> bool:
        start.wait(60)
        return write_once(tmp_path / "file", bytes([number]))

    with ThreadPoolExecutor(8) as pool:
        wrote = list(pool.map(write, range(8)))
    assert sum(wrote) == 1
    assert (tmp_path / "file").read_bytes() == bytes([wrote.index(True)])


def test_a_record_that_is_a_link_to_nowhere_is_replaced(store: Store, make_result: Make) -> None:
    path = store.record_path(make_result().id)
    path.parent.mkdir(parents=True)
    path.symlink_to("nowhere")
    assert store.put(make_result(), {}) == "stored"
    assert store.get(make_result().id) == make_result()
