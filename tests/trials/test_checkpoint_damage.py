"""A checkpoint that cannot be gone on from is named in a sentence without taking memory, and its way out works."""

from __future__ import annotations

import io
import json
import shutil
import tempfile
import tracemalloc
import zipfile
from collections.abc import Callable, Iterator
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


@pytest.fixture
def path(interrupted: Path, store: Store) -> Path:
    """The place of this checkpoint in another store, where it lies, too."""
    store.check_writable()
    store.checkpoints.mkdir()
    return Path(shutil.copy(interrupted, store.checkpoints))


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
def test_a_bad_checkpoint_is_named_and_moved_aside_by_verify(kind: str, path: Path, store: Store) -> None:
    path.write_bytes(DAMAGE[kind](path.read_bytes()))
    with pytest.raises(DamagedFileError, match=f"run `evoclaims verify --storage {store.root}`") as caught:
        checkpoint.find(store.checkpoints, CONDITION.id, "any")
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    (problem,) = verify(store, repair=True)
    assert (problem.kind, problem.path) == ("checkpoint", path)
    assert checkpoint.find(store.checkpoints, CONDITION.id, "any") == []


def test_a_checkpoint_of_another_program_says_that_it_is_to_be_deleted(
    path: Path, store: Store, cpus: list[Any], digests: list[str]
) -> None:
    arrays = unpack(path.read_bytes())
    path.write_bytes(pack({**arrays, "0001": np.zeros((2, 9), np.float32)}))
    with pytest.raises(UserError, match="Delete it; its trials then start again") as caught:
        run(CONDITION, [1, 5], store, cpus)
    assert str(path) in str(caught.value)
    path.unlink()
    assert [result.digest for result in run(CONDITION, [1, 5], store, cpus)] == digests


def test_a_checkpoint_of_a_later_format_is_passed_over_and_reported(path: Path, store: Store) -> None:
    path.write_bytes(_reheaded(path.read_bytes(), schema=2, chunks="two", widths=[4]))
    assert checkpoint.find(store.checkpoints, CONDITION.id, "any") == []
    assert fault(path) == "it has schema 2, not 1"


def test_the_checkpoint_of_another_condition_stops_nothing(store: Store, cpus: list[Any]) -> None:
    other = store.checkpoints / f"{'0' * 64}-{'0' * 16}.npz"
    store.check_writable()
    store.checkpoints.mkdir()
    other.write_bytes(b"torn")
    assert len(run(CONDITION, [1], store, cpus)) == 1


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_no_byte_changed_in_a_checkpoint_goes_unnoticed_or_leads_astray(data: st.DataObject) -> None:
    """Either the damage is seen, or it hit a byte that carries nothing (as some of a zip's do)."""
    header = checkpoint.Header("0" * 64, "p", [3], [3], 2, {"3": {"steps": [1.0]}}, 0.5, 0.5, "now", "")
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


LARGE = 1 << 26
"""Bytes that a bomb unpacks to: enough to be seen, little enough for a machine on which the test fails."""
BOUND = 1 << 25
"""Bytes that reading one may take: the largest file below that is read at all has about two megabytes."""


def npy(shape: tuple[int, ...], data: bytes = b"") -> bytes:
    """Return an array of doubles as npy claims it, followed by what it has."""
    file = io.BytesIO()
    np.lib.format.write_array_header_1_0(file, {"shape": shape, "fortran_order": False, "descr": "<f8"})
    return file.getvalue() + data


def with_part(path: Path, name: str, content: bytes, packing: int = zipfile.ZIP_STORED) -> None:
    """Put one more part into a checkpoint, or another one in place of what has this name."""
    arrays = {key: array for key, array in unpack(path.read_bytes()).items() if key != name}
    path.write_bytes(pack(arrays))
    with zipfile.ZipFile(path, "a", packing) as archive:
        archive.writestr(f"{name}.npy", content)


def in_place_of_a_leaf(shape: tuple[int, ...], data: bytes = b"", packing: int = zipfile.ZIP_STORED) -> Any:
    return lambda path: with_part(path, "0001", npy(shape, data), packing)


def header_that_unpacks(path: Path) -> None:
    header = unpack(path.read_bytes())["header"].tobytes()
    file = io.BytesIO()
    np.lib.format.write_array(file, np.frombuffer(header + b" " * LARGE, np.uint8))
    with_part(path, "header", file.getvalue(), zipfile.ZIP_DEFLATED)


def header_nested_deeply(path: Path) -> None:
    text = b"[" * 200_000 + b"]" * 200_000
    path.write_bytes(pack({**unpack(path.read_bytes()), "header": np.frombuffer(text, np.uint8)}))


def parts_that_overlap(path: Path) -> None:
    """Many names for one stored part of four megabytes."""
    with_part(path, "0001", npy((1 << 19,), bytes(1 << 22)))
    with zipfile.ZipFile(path, "a") as archive:
        (part,) = [entry for entry in archive.infolist() if entry.filename == "0001.npy"]
        for number in range(LARGE >> 22):
            entry = zipfile.ZipInfo(f"{1000 + number}.npy")
            entry.header_offset, entry.CRC = part.header_offset, part.CRC
            entry.file_size = entry.compress_size = part.file_size
            archive.filelist.append(entry)
            archive.NameToInfo[entry.filename] = entry
        archive._didModify = True  # type: ignore[attr-defined]  # so that the longer list is written


def terabyte_of_nothing(path: Path) -> None:
    with path.open("r+b") as file:
        file.truncate(1 << 40)


BOMBS: dict[str, Callable[[Path], None]] = {
    "claims more numbers than a machine can count": in_place_of_a_leaf((10**12, 10**12), bytes(64)),
    "claims numbers that would fit": in_place_of_a_leaf((LARGE // 8,), bytes(64)),
    "claims no numbers and has some": in_place_of_a_leaf((10**12, 0), bytes(64)),
    "unpacks": in_place_of_a_leaf((LARGE // 8,), bytes(LARGE), zipfile.ZIP_DEFLATED),
    "has a header that unpacks": header_that_unpacks,
    "has a header nested deeply": header_nested_deeply,
    "has parts that overlap": parts_that_overlap,
    "is a terabyte of nothing": terabyte_of_nothing,
}


@pytest.fixture
def memory() -> Iterator[Callable[[], int]]:
    """A function that returns how many bytes were taken at most since it was last called."""
    tracemalloc.start()

    def most() -> int:
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.reset_peak()
        return most

    yield most
    tracemalloc.stop()


@pytest.mark.parametrize("kind", BOMBS)
def test_a_bomb_takes_no_memory_and_is_named(
    kind: str, path: Path, store: Store, cpus: list[Any], memory: Callable[[], int]
) -> None:
    BOMBS[kind](path)
    memory()
    with pytest.raises(DamagedFileError, match=f"readable checkpoint; run `evoclaims verify --storage {store.root}`"):
        run(CONDITION, [1, 5], store, cpus)
    assert memory() < BOUND
    (problem,) = verify(store, repair=True)
    assert (problem.kind, problem.path) == ("checkpoint", path)
    assert memory() < BOUND


def test_a_large_state_of_another_program_is_refused_before_it_is_read(
    path: Path, store: Store, cpus: list[Any], memory: Callable[[], int]
) -> None:
    """Nothing is wrong with this file but its size, which only the condition's program can tell."""
    with_part(path, "0001", npy((LARGE // 8,), bytes(LARGE)))
    memory()
    assert checkpoint.fault(path) is None
    with pytest.raises(UserError, match="Delete it; its trials then start again"):
        run(CONDITION, [1, 5], store, cpus)
    assert memory() < BOUND


def test_a_long_header_is_refused_before_it_is_read(path: Path, memory: Callable[[], int]) -> None:
    arrays = unpack(path.read_bytes())
    header = json.loads(arrays["header"].tobytes())
    long = json.dumps({**header, "started": "x" * LARGE}).encode()
    path.write_bytes(pack({**arrays, "header": np.frombuffer(long, np.uint8)}))
    del long
    memory()
    assert checkpoint.fault(path) == "its header is longer than that of any batch of trials"
    assert memory() < BOUND
