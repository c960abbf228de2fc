"""A checkpoint that cannot be gone on from is named in a sentence, and its way out works."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from trial_toys import StoppedError, stopping, walk

from evoclaims.core.errors import UserError
from evoclaims.trials import checkpoint
from evoclaims.trials.arrays import pack, unpack
from evoclaims.trials.checkpoint import fault
from evoclaims.trials.integrity import verify
from evoclaims.trials.runner import run
from evoclaims.trials.store import DamagedFileError, Store

pytestmark = pytest.mark.oldest

CONDITION = walk(chance=0.35)


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory: pytest.TempPathFactory, cpus: list[Any]) -> Path:
    """The checkpoint of two trials that were stopped after their second report."""
    store = Store(tmp_path_factory.mktemp("interrupted"))
    with pytest.raises(StoppedError):
        run(CONDITION, [1, 5], store, cpus, stopping(2), checkpoint_seconds=0.0)
    (path,) = store.checkpoints.iterdir()
    return path


@pytest.fixture(scope="module")
def digests(tmp_path_factory: pytest.TempPathFactory, cpus: list[Any]) -> list[str]:
    return [r.digest for r in run(CONDITION, [1, 5], Store(tmp_path_factory.mktemp("whole")), cpus)]


def _reheaded(data: bytes, **fields: Any) -> bytes:
    arrays = unpack(data)
    header = {**json.loads(arrays["header"].tobytes()), **fields}
    kept = {name: value for name, value in header.items() if value != "dropped"}
    return pack({**arrays, "header": np.frombuffer(json.dumps(kept).encode(), np.uint8)})


def _without_header(data: bytes) -> bytes:
    return pack({name: array for name, array in unpack(data).items() if name != "header"})


DAMAGE: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda data: b"",
    "torn": lambda data: data[: len(data) // 2],
    "a digit changed": lambda data: data.replace(b'"chunks": 2', b'"chunks": 3'),
    "another file": lambda data: b"PK\x03\x04 not really",
    "arrays of someone else": lambda data: pack({"weights": np.zeros(3)}),
    "no header": _without_header,
    "a header that is a list": lambda data: pack({"header": np.frombuffer(b"[1]", np.uint8)}),
    "a field too few": lambda data: _reheaded(data, chunks="dropped"),
    "a field too many": lambda data: _reheaded(data, pickle="no"),
    "lanes that are no list": lambda data: _reheaded(data, lanes=5),
    "lanes of other seeds": lambda data: _reheaded(data, lanes=[7, 8]),
    "chunks that are no number": lambda data: _reheaded(data, chunks="two"),
    "curves of other seeds": lambda data: _reheaded(data, curves={}),
    "another batch": lambda data: _reheaded(data, batch=[1, 5, 6], curves={"1": {}, "5": {}, "6": {}}),
    "another platform": lambda data: _reheaded(data, platform="0" * 64),
}


@pytest.mark.parametrize("kind", DAMAGE)
def test_a_bad_checkpoint_is_named_and_moved_aside_by_verify(kind: str, interrupted: Path, store: Store) -> None:
    path = store.checkpoints / interrupted.name
    path.parent.mkdir(parents=True)
    path.write_bytes(DAMAGE[kind](interrupted.read_bytes()))
    with pytest.raises(DamagedFileError, match=f"run `evoclaims verify --storage {store.root}`") as caught:
        checkpoint.find(store.checkpoints, CONDITION.id, "any")
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    (problem,) = verify(store, repair=True, checkpoint_fault=fault)
    assert (problem.kind, problem.path) == ("checkpoint", path)
    assert checkpoint.find(store.checkpoints, CONDITION.id, "any") == []


def test_a_checkpoint_of_another_program_says_that_it_is_to_be_deleted(
    interrupted: Path, store: Store, cpus: list[Any], digests: list[str]
) -> None:
    arrays = unpack(interrupted.read_bytes())
    path = store.checkpoints / interrupted.name
    path.parent.mkdir(parents=True)
    path.write_bytes(pack({**arrays, "0001": np.zeros((2, 9), np.float32)}))
    with pytest.raises(UserError, match="Delete it; its trials then start again") as caught:
        run(CONDITION, [1, 5], store, cpus)
    assert str(path) in str(caught.value)
    path.unlink()
    assert [result.digest for result in run(CONDITION, [1, 5], store, cpus)] == digests


def test_a_checkpoint_of_a_later_format_is_passed_over_and_reported(interrupted: Path, store: Store) -> None:
    path = store.checkpoints / interrupted.name
    path.parent.mkdir(parents=True)
    path.write_bytes(_reheaded(interrupted.read_bytes(), schema=2, chunks="two", widths=[4]))
    assert checkpoint.find(store.checkpoints, CONDITION.id, "any") == []
    assert fault(path) == "it has schema 2, not 1"


def test_the_checkpoint_of_another_condition_stops_nothing(interrupted: Path, store: Store, cpus: list[Any]) -> None:
    other = store.checkpoints / f"{'0' * 64}-{'0' * 16}.npz"
    other.parent.mkdir(parents=True)
    other.write_bytes(b"torn")
    assert len(run(CONDITION, [1], store, cpus)) == 1


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_no_byte_changed_in_a_checkpoint_goes_unnoticed_or_leads_astray(data: st.DataObject) -> None:
    """Either the damage is seen, or it hit a byte that carries nothing (as some of a zip's do)."""
    header = checkpoint.Header("0" * 64, "p", [3], [3], 2, {"3": {"steps": [1.0]}}, 0.5, 0.5, "now")
    with tempfile.TemporaryDirectory() as folder:
        path = checkpoint.path_of(Path(folder), header)
        checkpoint.save(Path(folder), header, np.arange(5.0))  # type: ignore[arg-type]
        whole = path.read_bytes()
        place = data.draw(st.integers(0, len(whole) - 1))
        value = data.draw(st.integers(0, 255).filter(lambda byte: byte != whole[place]))
        path.write_bytes(whole[:place] + bytes([value]) + whole[place + 1 :])
        try:
            found = checkpoint.newest(Path(folder), header)
            state = checkpoint.restore(Path(folder), header, np.arange(5.0))
        except DamagedFileError:
            return
        assert found == header
        np.testing.assert_array_equal(state, np.arange(5.0))
