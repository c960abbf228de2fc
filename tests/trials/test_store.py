"""The store gives back what was put into it, under any sharing, and reports what it cannot use."""

from __future__ import annotations

import dataclasses
import os
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
from evoclaims.trials.store import DamagedFileError, Store, gives_way
from evoclaims.trials.store_files import mark

pytestmark = pytest.mark.oldest

Make = Callable[..., TrialResult]

numbers = st.floats(allow_nan=True, allow_infinity=True) | st.integers(-(2**60), 2**60)
names = st.text(max_size=8)
vectors = st.dictionaries(names, st.lists(numbers, max_size=4).map(tuple), max_size=3)
equal_vectors = st.integers(0, 4).flatmap(
    lambda length: st.dictionaries(names, st.tuples(*[numbers] * length), max_size=3)
)


@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 2**31 - 1),
    st.sampled_from(["done", "diverged", "timeout", "crashed"]),
    st.dictionaries(names, numbers, max_size=4),
    vectors,
    equal_vectors,
)
def test_what_is_put_is_got(make_result: Make, seed: int, status: str, metrics: Any, levels: Any, curves: Any) -> None:
    result = make_result(seed, status, metrics, levels, curves)
    with tempfile.TemporaryDirectory() as folder:
        store = Store(Path(folder))
        assert store.get(result.id) is None
        assert (store.ids(), list(store.results([]))) == ((), [])
        assert store.put(result, {}) == "stored"
        back = store.get(result.id)
        assert back is not None
        assert store.champion_of(back) == {}
        assert not store.champion_path(result.id).exists()
    assert dump(back) == dump(result)


def test_a_text_that_is_no_number_word_stays_out_of_metrics(store: Store, make_result: Make) -> None:
    with pytest.raises(ValueError, match="its metrics field is not as the schema says: Invalid enum value 'NaN'"):
        store.put(make_result(metrics={"m": "NaN"}), {})
    assert store.ids() == ()


def test_a_result_whose_id_does_not_follow_from_its_specification_is_refused(store: Store, make_result: Make) -> None:
    with pytest.raises(ValueError, match="id is not the hash"):
        store.put(dataclasses.replace(make_result(), id="0" * 64), {})


def test_a_champion_comes_back_from_where_it_lies_with_shapes_and_types(
    store: Store, trial: TrialResult, parameters: dict[str, Any]
) -> None:
    files = sorted(path.relative_to(store.root).as_posix() for path in store.root.rglob("*") if path.is_file())
    prefix = trial.id[:2]
    names = [f"champions/{prefix}/{trial.id}.npz", "store.json", f"trials/{prefix}/{trial.id}.json"]
    assert files == [".gitignore", *names]
    back = store.champion_of(store.get(trial.id))
    assert back.keys() == parameters.keys()
    for name, array in parameters.items():
        assert back[name].dtype == array.dtype
        np.testing.assert_array_equal(back[name], array, strict=True)


def test_the_same_champion_gives_the_same_bytes_whenever_it_is_stored(
    tmp_path: Path, make_result: Make, parameters: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    result = make_result()
    for name, now in (("one", 1.0e9), ("two", 1.5e9)):
        monkeypatch.setattr("time.time", lambda now=now: now)
        Store(tmp_path / name).put(result, dict(reversed(parameters.items())) if name == "two" else parameters)
    one, two = (Store(tmp_path / name).champion_path(result.id).read_bytes() for name in ("one", "two"))
    assert one == two


@pytest.mark.parametrize("array", [np.array([object()]), np.zeros(2, np.dtype("V2"))], ids=["objects", "void"])
def test_an_array_that_would_need_pickle_is_refused(store: Store, make_result: Make, array: Any) -> None:
    with pytest.raises(ValueError, match="without pickle"):
        store.put(make_result(), {"w": array})
    assert store.ids() == ()


@pytest.mark.parametrize("text", ["../../etc/passwd", "0" * 63, "G" * 64, "A" * 64, "0" * 64 + "\n", ""])
def test_a_text_that_is_no_id_reaches_no_file(store: Store, text: str) -> None:
    for look_up in (store.get, store.record_path, store.champion_path):
        with pytest.raises(UserError, match="64 lower-case hexadecimal digits"):
            look_up(text)


def test_an_equal_trial_put_again_changes_nothing(
    store: Store, trial: TrialResult, make_result: Make, parameters: dict[str, Any]
) -> None:
    before = store.record_path(trial.id).read_bytes()
    again = dataclasses.replace(make_result(), timing={**trial.timing, "run": 99.0})
    assert store.put(again, parameters) == "present"
    assert store.record_path(trial.id).read_bytes() == before


def test_another_digest_keeps_the_first_trial_and_its_champion_and_says_so(
    store: Store, trial: TrialResult, make_result: Make, parameters: dict[str, Any]
) -> None:
    other = make_result(metrics={"mean_success": 0.0})
    assert store.put(other, {"bias": np.zeros(1)}) == "differs"
    assert store.put(make_result(status="diverged"), {}) == "differs"
    kept = store.get(trial.id)
    assert kept is not None
    assert kept.metrics == trial.metrics
    assert store.champion_of(store.get(trial.id)).keys() == parameters.keys()


def _timed_out(make_result: Make, seconds: float) -> TrialResult:
    made = make_result(status="timeout")
    return dataclasses.replace(made, timing={**made.timing, "limit": seconds})


@pytest.mark.parametrize("status", ["done", "diverged", "crashed"])
def test_a_trial_that_ran_out_of_time_gives_way_to_any_other_end_and_never_takes_its_place(
    store: Store, make_result: Make, parameters: dict[str, Any], status: str
) -> None:
    late, ended = _timed_out(make_result, 5.0), make_result(status=status)
    assert store.put(late, {}) == "stored"
    assert store.put(ended, parameters) == "stored"
    kept = store.get(ended.id)
    assert kept is not None
    assert (kept.status, sorted(store.champion_of(store.get(ended.id)))) == (status, sorted(parameters))
    if status == "crashed":
        assert store.put(make_result(), {"w": np.ones(1)}) == "stored"
        assert store.put(make_result(metrics={"mean_success": 0.0}), {"w": np.full(1, 2.0)}) == "differs"
        assert store.champion_of(store.get(ended.id))["w"].tolist() == [1.0]
    else:
        assert store.put(_timed_out(make_result, 50.0), {}) == "differs"


def test_of_two_ends_of_its_time_the_one_that_had_more_stays(store: Store, make_result: Make) -> None:
    for seconds, became, kept in (
        (5.0, "stored", 5.0),
        (3.0, "present", 5.0),
        (5.0, "present", 5.0),
        (8.0, "stored", 8.0),
    ):
        assert store.put(_timed_out(make_result, seconds), {}) == became
        found = store.get(make_result().id)
        assert found is not None
        assert found.timing["limit"] == kept


@pytest.mark.parametrize(("first", "second"), [("crashed", "timeout"), ("timeout", "crashed"), ("crashed", "crashed")])
def test_of_two_failures_the_later_stays_in_whatever_order_they_come(
    make_result: Make, first: str, second: str
) -> None:
    def ended(status: str, when: str) -> TrialResult:
        made = make_result(status=status)
        return dataclasses.replace(made, timing={**made.timing, "ended": when}, digest=when)

    early, late = ended(first, "2026-01-01T00:00:00"), ended(second, "2026-01-02T00:00:00")
    assert gives_way(early, late)
    assert not gives_way(late, early)


def test_a_champion_is_written_before_its_record(
    store: Store, make_result: Make, parameters: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    placed = []
    mark(store.root)
    link = os.link
    monkeypatch.setattr(os, "link", lambda a, b: (placed.append(Path(b).suffix), link(a, b)))
    store.put(make_result(), parameters)
    assert placed == [".npz", ".json"]


def test_one_bad_file_costs_no_other_trial(store: Store, make_result: Make) -> None:
    results = [make_result(seed) for seed in range(4)]
    for result in results:
        store.put(result, {})
    bad = store.record_path(results[2].id)
    bad.write_bytes(b"{")
    stray = store.root / "trials" / "notes.txt"
    stray.write_text("mine")
    bad.with_name(f".{bad.name}.123.abcd.tmp").write_bytes(b'{"sch')  # which a kill has left
    errors: list[DamagedFileError] = []
    read = [result.id for result in store.results(errors)]
    assert read == sorted(results[i].id for i in (0, 1, 3))
    assert {error.path for error in errors} == {bad, stray}
    assert store.ids() == tuple(sorted(result.id for result in results))
