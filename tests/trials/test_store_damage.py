"""A record or champion that is torn, edited, swapped or foreign is an error that names the file and the way out."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoclaims.trials.integrity import verify
from evoclaims.trials.result import TrialResult
from evoclaims.trials.result_codec import RecordError, dump, parse
from evoclaims.trials.store import DamagedFileError, Store

pytestmark = pytest.mark.oldest

Make = Callable[..., TrialResult]
Edit = Callable[..., None]


def complaint(store: Store, trial_id: str) -> str:
    """Return what `get` says, after checking that it names the file and the way out."""
    with pytest.raises(DamagedFileError) as caught:
        store.get(trial_id)
    text = str(caught.value)
    assert str(store.record_path(trial_id)) in text
    assert f"run `evoclaims verify --storage {store.root}`" in text
    assert "\n" not in text
    return text


@pytest.mark.parametrize(
    ("root", "command"),
    [
        (".evoclaims", "verify"),
        ("../.evoclaims", "verify"),
        ("../b/.evoclaims", "verify"),
        ("../c/.evoclaims", "verify --storage ../c/.evoclaims"),
        ("trials/my store", "verify --storage 'trials/my store'"),
    ],
)
def test_the_way_out_names_the_store_that_a_damaged_file_is_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, root: str, command: str
) -> None:
    (tmp_path / "a" / "b").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "a" / "b")
    store, some = Store(Path(root)), "0" * 64
    for path in (store.record_path(some), store.champion_path(some), store.checkpoints / "0.npz"):
        assert f"run `evoclaims {command}`," in str(DamagedFileError(path, "it is torn"))


@given(st.data())
def test_a_record_cut_short_anywhere_is_refused(make_result: Make, data: st.DataObject) -> None:
    record = dump(make_result())
    length = data.draw(st.integers(0, len(record) - 2))
    with pytest.raises(RecordError):
        parse(record[:length])


@given(st.data())
def test_no_flipped_byte_changes_what_a_record_says(make_result: Make, data: st.DataObject) -> None:
    result = make_result(metrics={"a": 0.1, "b": float("nan")})
    record = bytearray(dump(result))
    record[data.draw(st.integers(0, len(record) - 1))] ^= data.draw(st.integers(1, 255))
    try:
        back = parse(bytes(record))
    except RecordError:
        return
    assert dump(back) == dump(result)


plain = st.recursive(st.none() | st.booleans() | st.floats() | st.text(max_size=5), st.lists, max_leaves=5) | st.text()


@given(plain.map(json.dumps) | st.binary(max_size=60))
def test_any_other_json_or_bytes_are_refused_and_crash_nothing(data: str | bytes) -> None:
    with pytest.raises(RecordError):
        parse(data)


@pytest.mark.parametrize("depth", [900, 100_000])  # too deep for the hash, and for the JSON reader too
def test_a_deeply_nested_text_is_refused_and_crashes_nothing(make_result: Make, depth: int) -> None:
    nested = "[" * depth + "]" * depth
    for text in (nested, dump(make_result()).decode().replace('"git":null', f'"git":{nested}')):
        with pytest.raises(RecordError):
            parse(text)


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (lambda text: text[:100], "not one whole JSON text"),
        (lambda text: text.replace('"status":', '"status":"crashed","status":'), "not one whole JSON text"),
        (lambda text: text.replace("0.75", "0.76"), "seal"),
        (lambda text: text.replace('"mean_success":0.75', '"mean_success":1e999'), "a number in it is too large"),
        (lambda text: re.sub(',"timing":{[^}]*}', "", text), "missing or unknown: timing"),
    ],
    ids=["truncated", "a key named twice", "a metric", "an infinity", "a field too few"],
)
def test_an_edited_text_is_named_with_the_way_out(
    store: Store, trial: TrialResult, edit: Callable[[str], str], said: str
) -> None:
    path = store.record_path(trial.id)
    path.write_text(edit(path.read_text()))
    assert said in complaint(store, trial.id)


@pytest.mark.parametrize("schema", [2, 10**6])
def test_a_record_of_a_later_release_is_left_where_it_is(
    store: Store, trial: TrialResult, edit_record: Edit, schema: int
) -> None:
    edit_record(store.record_path(trial.id), schema=schema)
    with pytest.raises(DamagedFileError, match=rf"its schema is {schema} and .*; use that later version, or another"):
        store.get(trial.id)
    (problem,) = verify(store, repair=True)
    assert (problem.path, problem.moved_to) == (store.record_path(trial.id), None)
    assert problem.path.exists()
    assert store.champion_path(trial.id).exists()
    assert str(problem).endswith("(left there)")


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        *(({"schema": schema}, f"its schema is {schema!r}") for schema in (0, "1", True, None)),
        ({"\x1b]0;owned\x07\n": 1}, r"missing or unknown: \x1b]0;owned"),
        ({"status": "fine"}, "its status field is not as the schema says: Invalid enum value 'fine'"),
        ({"status": ["done"]}, "its status field is not as the schema says: Expected `str`, got `array`"),
        ({"seed": 1}, "seed"),
        ({"seed": -1}, "seed"),
        ({"seed": "0"}, "seed"),
        ({"spec": []}, "its spec field is not as the schema says: Expected `object`, got `array`"),
        ({"spec": {"seed": 0}}, "hash of its specification"),
        ({"condition": "0" * 64}, "condition"),
        ({"digest": "abc"}, "digest"),
        ({"champion": "../champion"}, "champion"),
        ({"metrics": {"m": True}}, "metrics"),
        ({"metrics": {"m": "Infinity"}}, "metrics"),
        ({"levels": {"success": 1.0}}, "levels"),
        ({"curves": {"best": [None]}}, "curves"),
        ({"curves": {"best": [1.0], "mean": []}}, "equally long"),
        ({"timing": "1 s"}, "timing"),
        ({"provenance": 3}, "provenance"),
        ({"surprise": 1}, "missing or unknown: surprise"),
    ],
)
def test_a_field_of_the_wrong_kind_is_refused_even_under_a_right_seal(
    store: Store, trial: TrialResult, edit_record: Edit, fields: dict[str, Any], reason: str
) -> None:
    edit_record(store.record_path(trial.id), **fields)
    assert reason in (text := complaint(store, trial.id))
    assert text.isprintable()


def test_a_record_under_another_trials_name_is_foreign(store: Store, trial: TrialResult, make_result: Make) -> None:
    other = make_result(7)
    store.record_path(other.id).parent.mkdir(parents=True, exist_ok=True)
    store.record_path(trial.id).rename(store.record_path(other.id))
    assert f"it holds another trial, {trial.id}" in complaint(store, other.id)


def test_a_swapped_champion_is_refused(store: Store, trial: TrialResult, make_result: Make) -> None:
    other = make_result(1)
    store.put(other, {"bias": np.ones(2)})
    store.champion_path(trial.id).write_bytes(store.champion_path(other.id).read_bytes())
    with pytest.raises(DamagedFileError, match="not the champion that the trial's record names") as caught:
        store.champion_of(store.get(trial.id))
    assert caught.value.path == store.champion_path(trial.id)


@pytest.mark.parametrize("data", [b"", b"PK\x03\x04 and more", b"\x80\x04N.", b"\x93NUMPY"])
def test_a_champion_that_is_no_npz_is_refused_though_its_hash_is_right(
    store: Store, trial: TrialResult, edit_record: Edit, data: bytes
) -> None:
    store.champion_path(trial.id).write_bytes(data)
    edit_record(store.record_path(trial.id), champion=hashlib.sha256(data).hexdigest())
    with pytest.raises(DamagedFileError, match="not a readable npz file"):
        store.champion_of(store.get(trial.id))


def test_a_pickle_inside_a_champion_is_never_opened(store: Store, trial: TrialResult, edit_record: Edit) -> None:
    path = store.champion_path(trial.id)
    with open(path, "wb") as file:
        np.savez(file, allow_pickle=True, w=np.array([{"a": 1}], dtype=object))
    edit_record(store.record_path(trial.id), champion=hashlib.sha256(path.read_bytes()).hexdigest())
    with pytest.raises(DamagedFileError, match="not a readable npz file"):
        store.champion_of(store.get(trial.id))
