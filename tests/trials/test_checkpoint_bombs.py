"""A checkpoint that claims to be enormous, or unpacks to be so, takes no memory: it is named in a sentence."""

from __future__ import annotations

import io
import json
import tracemalloc
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from trial_toys import StoppedError, stopping, walk

from evoclaims.core.errors import UserError
from evoclaims.trials import checkpoint
from evoclaims.trials.arrays import pack, unpack
from evoclaims.trials.integrity import verify
from evoclaims.trials.runner import run
from evoclaims.trials.store import DamagedFileError, Store

pytestmark = pytest.mark.oldest

CONDITION = walk(chance=0.35)
LARGE = 1 << 28
"""Bytes that a bomb unpacks to: enough to be seen, little enough for a machine on which the test fails."""
BOUND = 1 << 25
"""Bytes that reading one may take: the largest file below that is read at all has about two megabytes."""


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory, cpus: list[Any]) -> Path:
    """The checkpoint of two trials that were stopped after their second report."""
    store = Store(tmp_path_factory.mktemp("interrupted"))
    with pytest.raises(StoppedError):
        run(CONDITION, [1, 5], store, cpus, stopping(2), checkpoint_seconds=0.0)
    (path,) = store.checkpoints.iterdir()
    return path


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
    "claims ten to the twelfth numbers": in_place_of_a_leaf((10**12,), bytes(64)),
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
    kind: str, whole: Path, store: Store, cpus: list[Any], memory: Callable[[], int]
) -> None:
    path = store.checkpoints / whole.name
    path.parent.mkdir(parents=True)
    path.write_bytes(whole.read_bytes())
    BOMBS[kind](path)
    memory()
    with pytest.raises(DamagedFileError, match=f"readable checkpoint; run `evoclaims verify --storage {store.root}`"):
        run(CONDITION, [1, 5], store, cpus)
    assert memory() < BOUND
    (problem,) = verify(store, repair=True, checkpoint_fault=checkpoint.fault)
    assert (problem.kind, problem.path) == ("checkpoint", path)
    assert memory() < BOUND


def test_a_large_state_of_another_program_is_refused_before_it_is_read(
    whole: Path, store: Store, cpus: list[Any], memory: Callable[[], int]
) -> None:
    """Nothing is wrong with this file but its size, which only the condition's program can tell."""
    path = store.checkpoints / whole.name
    path.parent.mkdir(parents=True)
    path.write_bytes(whole.read_bytes())
    with_part(path, "0001", npy((LARGE // 8,), bytes(LARGE)))
    memory()
    assert checkpoint.fault(path) is None
    with pytest.raises(UserError, match="Delete it; its trials then start again"):
        run(CONDITION, [1, 5], store, cpus)
    assert memory() < BOUND


def test_a_long_header_is_refused_before_it_is_read(whole: Path, store: Store, memory: Callable[[], int]) -> None:
    arrays = unpack(whole.read_bytes())
    header = json.loads(arrays["header"].tobytes())
    path = store.checkpoints / whole.name
    path.parent.mkdir(parents=True)
    long = json.dumps({**header, "started": "x" * (LARGE // 2)}).encode()
    path.write_bytes(pack({**arrays, "header": np.frombuffer(long, np.uint8)}))
    del long
    memory()
    assert checkpoint.fault(path) == "its header is longer than that of any batch of trials"
    assert memory() < BOUND
