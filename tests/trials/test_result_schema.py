"""A record under a right seal is still refused when its fields are not what the rest of the code takes for granted."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evoclaims.core.canonical import content_hash
from evoclaims.trials.integrity import verify
from evoclaims.trials.result import TrialResult
from evoclaims.trials.result_codec import RecordError, dump, parse
from evoclaims.trials.store import DamagedFileError, Store

Make = Callable[..., TrialResult]
Edit = Callable[..., None]

REFERENCE = Path(__file__).parents[2] / "reproductions" / "nisioti2025" / "reference"


def nested(depth: int) -> Any:
    """Return an empty list in `depth` lists."""
    value: Any = []
    for _ in range(depth):
        value = [value]
    return value


def without(table: dict[str, Any], name: str) -> dict[str, Any]:
    """Return a table that lacks an entry."""
    return {key: value for key, value in table.items() if key != name}


ODD: dict[str, Callable[[dict[str, Any]], dict[str, Any]]] = {
    "provenance.device": lambda r: {"provenance": {"device": "cpu"}},
    "provenance.device.kind": lambda r: {"provenance": {"device": {"platform": "cpu", "kind": 7}}},
    "provenance.git": lambda r: {"provenance": {"git": "abc"}},
    "provenance.git.sha": lambda r: {"provenance": {"git": {"sha": ["abc"]}}},
    "provenance.versions": lambda r: {"provenance": {"versions": [["jax", "1"]]}},
    "provenance.versions value": lambda r: {"provenance": {"versions": {"jax": {"major": 1}}}},
    "provenance.cuda": lambda r: {"provenance": {"cuda": "13"}},
    "provenance.machine": lambda r: {"provenance": {"machine": {"name": "a"}}},
    "provenance nested": lambda r: {"provenance": {"deep": nested(300)}},
    "provenance huge": lambda r: {"provenance": {"count": 10**400}},
    "timing.run": lambda r: {"timing": {**r["timing"], "run": "1 s"}},
    "timing.run negative": lambda r: {"timing": {**r["timing"], "run": -1.0}},
    "timing.run immense": lambda r: {"timing": {**r["timing"], "run": 1e300}},
    "timing.compile": lambda r: {"timing": {**r["timing"], "compile": None}},
    "timing.batch": lambda r: {"timing": {**r["timing"], "batch": "\x1b[2J"}},
    "timing.batch truth": lambda r: {"timing": {**r["timing"], "batch": True}},
    "timing.batch zero": lambda r: {"timing": {**r["timing"], "batch": 0}},
    "timing.started": lambda r: {"timing": {**r["timing"], "started": {}}},
    "timing without run": lambda r: {"timing": without(r["timing"], "run")},
    "timing nested": lambda r: {"timing": {**r["timing"], "deep": nested(300)}},
    "metrics empty": lambda r: {"metrics": {}},
    "metrics without steps": lambda r: {"metrics": without(r["metrics"], "steps")},
    "metrics steps nan": lambda r: {"metrics": {**r["metrics"], "steps": "nan"}},
    "metrics environment_steps infinite": lambda r: {"metrics": {**r["metrics"], "environment_steps": "inf"}},
    "metrics huge": lambda r: {"metrics": {**r["metrics"], "mean_success": 10**400}},
    "levels empty": lambda r: {"levels": {}},
    "metrics success above 1": lambda r: {"metrics": {**r["metrics"], "mean_success": 7.5}},
    "metrics success below 0": lambda r: {"metrics": {**r["metrics"], "last_success": -3}},
    "levels success above 1": lambda r: {"levels": {**r["levels"], "success": [1.0, 9.0]}},
    "curves success above 1": lambda r: {"curves": {"success": [0.5, 1.1]}},
    "levels of nothing": lambda r: {"levels": {**r["levels"], "success": []}},
    "curves huge": lambda r: {"curves": {"best": [10**400]}},
    "seed huge": lambda r: of_spec({**r["spec"], "seed": 10**400}),
    "seed beyond the device": lambda r: of_spec({**r["spec"], "seed": 2**31}),
    "spec nested": lambda r: of_spec({**r["spec"], "deep": nested(300)}),
    "spec method": lambda r: of_spec({**r["spec"], "method": "neat"}),
    "champion": lambda r: {"champion": "0" * 64 + "\n"},
    "seal nested": lambda r: {"seal": nested(300)},
}


def of_spec(spec: dict[str, Any]) -> dict[str, Any]:
    """Return the fields that follow from a specification."""
    plain = {"spec": spec, "seed": spec["seed"], "id": content_hash(spec)}
    return {**plain, "condition": content_hash(without(spec, "seed"))}


def forged(record: bytes, change: Callable[[dict[str, Any]], dict[str, Any]]) -> bytes:
    """Return a record with changed fields under the seal that they call for, written as `dump` writes."""
    plain = json.loads(record)
    changes = change(plain)
    plain.update(changes)
    if "seal" not in changes:
        text = json.dumps(without(plain, "seal"), sort_keys=True, separators=(",", ":"))
        plain["seal"] = hashlib.sha256(text.encode()).hexdigest()
    return json.dumps(plain, sort_keys=True, separators=(",", ":")).encode()


@pytest.mark.parametrize("name", ODD)
def test_odd_types_are_refused_by_every_reader_and_moved_aside(store: Store, make_result: Make, name: str) -> None:
    record = forged(dump(make_result()), ODD[name])
    with pytest.raises(RecordError) as caught:
        parse(record)
    assert "Traceback" not in str(caught.value)
    assert "\x1b" not in str(caught.value)
    trial_id = json.loads(record)["id"]
    path = store.record_path(trial_id)
    store.check_writable()
    path.parent.mkdir(parents=True)
    path.write_bytes(record)
    with pytest.raises(DamagedFileError, match="evoclaims verify"):
        store.get(trial_id)
    errors: list[DamagedFileError] = []
    assert list(store.results(errors)) == []
    assert len(errors) == 1
    (problem,) = verify(store, repair=True)
    assert problem.kind == "record"
    assert store.get(trial_id) is None


def test_a_trial_that_was_ended_from_outside_need_not_have_all_metrics(make_result: Make) -> None:
    record = forged(dump(make_result(status="timeout")), lambda r: {"metrics": {}, "levels": {}})
    assert parse(record).metrics == {}


json_values = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**30), 10**30) | st.floats(allow_nan=False) | st.text(max_size=4),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner, max_size=3),
    max_leaves=6,
)
FIELDS = ("spec", "seed", "status", "metrics", "levels", "curves", "digest", "timing", "provenance", "champion", "id")


@settings(max_examples=200, deadline=None)
@given(st.sampled_from(FIELDS), json_values)
def test_any_json_in_any_field_is_read_or_refused_with_a_sentence(make_result: Make, field: str, value: Any) -> None:
    record = forged(dump(make_result()), lambda r: {field: value})
    refused = None
    try:
        result = parse(record)
    except RecordError as error:
        refused = str(error)
    assert json.loads(dump(result))[field] == value if refused is None else refused.isprintable()


def test_every_committed_record_is_accepted_and_written_back_to_the_same_bytes() -> None:
    lines = [line for path in sorted(REFERENCE.rglob("*.jsonl")) for line in path.read_bytes().splitlines()]
    assert len(lines) > 700
    assert all(dump(parse(line)).rstrip(b"\n") == line for line in lines)
