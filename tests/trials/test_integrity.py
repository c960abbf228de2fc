"""`verify` reads a whole store back, lists what is wrong, and moves bad files aside without deleting any."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from evoclaims.core.errors import UserError
from evoclaims.trials import integrity
from evoclaims.trials.integrity import Problem, verify
from evoclaims.trials.lease import announced, lease_path
from evoclaims.trials.result import TrialResult, digest
from evoclaims.trials.store import Store

pytestmark = pytest.mark.oldest

Make = Callable[..., TrialResult]


def cut_the_record(store: Store, trial: TrialResult) -> None:
    path = store.record_path(trial.id)
    path.write_bytes(path.read_bytes()[:-20])


def edit_the_record(store: Store, trial: TrialResult) -> None:
    path = store.record_path(trial.id)
    path.write_text(path.read_text().replace("0.75", "0.76"))


def cut_the_champion(store: Store, trial: TrialResult) -> None:
    path = store.champion_path(trial.id)
    path.write_bytes(path.read_bytes()[:-20])


def lose_the_champion(store: Store, trial: TrialResult) -> None:
    store.champion_path(trial.id).unlink()


def age(path: Path, seconds: float = 3600.0) -> None:
    """Make a file look as if it was last written `seconds` ago."""
    then = time.time() - seconds
    os.utime(path, (then, then))


@pytest.mark.parametrize("field", ["metrics", "levels", "curves", "status"])
def test_an_edited_record_is_found_by_its_digest(
    field: str, store: Store, trial: TrialResult, edit_record: Any
) -> None:
    edited = {
        "metrics": {**trial.metrics, "last_success": 1.0},
        "levels": {**trial.levels, "success": (1.0, 1.0)},
        "curves": {"best": (0.25, 1.0)},
        "status": "diverged",
    }
    edit_record(store.record_path(trial.id), **{field: edited[field]})
    (problem,) = verify(store, repair=False)
    assert (problem.kind, problem.reason) == ("record", "its digest is not that of its contents, so it was edited")


@pytest.mark.parametrize(
    "fields", [{"status": "crashed", "provenance": {"crash": "killed"}}, {"status": "crashed"}, {"status": "timeout"}]
)
def test_a_trial_without_an_outcome_has_the_digest_of_its_reason(
    fields: dict[str, Any], store: Store, make_result: Make
) -> None:
    unfinished = replace(make_result(champion={}), **fields)
    said = fields.get("provenance", {}).get("crash", "").encode()
    made = digest(unfinished.status, unfinished.metrics, unfinished.levels, unfinished.curves, said)
    store.put(replace(unfinished, digest=made), {})
    assert verify(store, repair=False) == []


@pytest.mark.parametrize("damage", [cut_the_record, edit_the_record, cut_the_champion, lose_the_champion])
def test_damage_is_listed_and_a_repair_lets_the_trial_be_run_again_and_deletes_nothing(
    store: Store,
    trial: TrialResult,
    make_result: Make,
    parameters: dict[str, Any],
    damage: Callable[[Store, TrialResult], None],
) -> None:
    sound = make_result(1)
    store.put(sound, parameters)
    damage(store, trial)
    contents = {path.read_bytes() for path in store.root.rglob("*") if path.is_file()}
    listed = verify(store, repair=False)
    both = [("record", store.record_path(trial.id), None), ("champion", store.champion_path(trial.id), None)]
    assert [(one.kind, one.path, one.moved_to) for one in listed] == both[: 1 + (damage is not lose_the_champion)]
    for problem in verify(store, repair=True):
        assert problem.moved_to is not None
        assert problem.moved_to.parent == store.root / "quarantine"
        assert not problem.path.exists()
    assert {path.read_bytes() for path in store.root.rglob("*") if path.is_file()} == contents
    assert verify(store, repair=False) == []
    assert store.ids() == (sound.id,)
    assert store.get(trial.id) is None
    assert store.put(make_result(), parameters) == "stored"


def test_a_file_damaged_twice_is_kept_twice(store: Store, trial: TrialResult, make_result: Make) -> None:
    for text in (b"first", b"second"):
        store.record_path(trial.id).write_bytes(text)
        verify(store, repair=True)
    kept = (store.root / "quarantine").glob(f"{trial.id}.json*")
    assert {path.read_bytes() for path in kept} == {b"first", b"second"}


def test_foreign_files_are_listed_wherever_they_lie(store: Store, trial: TrialResult) -> None:
    record, champion = store.record_path(trial.id), store.champion_path(trial.id)
    strays = [
        store.root / "trials" / "notes.txt",
        store.root / "champions" / "notes.txt",
        record.with_name("copy of a record.json"),
        record.with_suffix(".txt"),
        champion.with_suffix(".pickle"),
    ]
    for path in strays:
        path.write_text("mine")
    misplaced = store.root / "trials" / "zz" / record.name
    misplaced.parent.mkdir()
    misplaced.write_bytes(record.read_bytes())
    wrong = record.parent.with_name("00" if record.parent.name != "00" else "01") / record.name
    wrong.parent.mkdir()
    wrong.write_bytes(record.read_bytes())
    problems = verify(store, repair=True)
    assert {problem.path for problem in problems} == {*strays, misplaced.parent, wrong}
    assert verify(store, repair=False) == []
    assert store.ids() == (trial.id,)


def test_what_a_kill_has_left_is_listed_once_nobody_can_be_at_it(store: Store, trial: TrialResult) -> None:
    """A half-written record, a champion whose record was never written, and a notice that nobody refreshes."""
    record, champion = store.record_path(trial.id), store.champion_path(trial.id)
    aside = record.with_name(f".{record.name}.123.abcd.tmp")
    aside.write_bytes(b'{"sch')
    record.unlink()
    with announced(store.root, trial.condition):
        left = {aside, champion, lease_path(store.root, trial.condition)}
        assert verify(store, repair=True) == []
        for path in left:
            age(path)
        assert {(problem.kind, problem.path) for problem in verify(store, repair=True)} == {
            ("leftover", path) for path in left
        }
    assert verify(store, repair=False) == []


def test_a_store_that_is_not_there_yet_has_no_problems_and_is_not_made(store: Store) -> None:
    assert verify(store, repair=True) == []
    assert not store.root.exists()


def test_a_file_that_cannot_be_moved_is_a_user_error(store: Store, trial: TrialResult) -> None:
    cut_the_record(store, trial)
    (store.root / "quarantine").write_text("in the way")
    with pytest.raises(UserError, match="move it by hand"):
        verify(store, repair=True)


def test_a_file_that_another_process_moved_first_is_no_error(
    store: Store, trial: TrialResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    cut_the_record(store, trial)
    settle = integrity._set_aside
    monkeypatch.setattr(integrity, "_set_aside", lambda store, path: (settle(store, path), settle(store, path))[1])
    assert [problem.moved_to for problem in verify(store, repair=True)] == [None, None]


def test_a_problem_reads_as_one_printable_line(store: Store) -> None:
    problem = Problem(Path("a\x1b[31m\nb"), "record", "it is torn", Path("quarantine/a"))
    assert str(problem).isprintable()
    assert "quarantine" in str(problem)
