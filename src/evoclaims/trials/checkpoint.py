"""Checkpoints of batches, written between device calls; resumed trials give the same bits."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import jax
import numpy as np
from msgspec import convert
from numpy.typing import NDArray

from evoclaims.core.canonical import content_hash
from evoclaims.core.errors import UserError
from evoclaims.core.files import open_file, write_atomically
from evoclaims.trials.arrays import Packed, pack
from evoclaims.trials.program import TrialState
from evoclaims.trials.result_codec import is_hash
from evoclaims.trials.store import DamagedFileError
from evoclaims.trials.store_files import ELSEWHERE

SCHEMA: Final = 1
_HEADER: Final = "header"
_HEADER_BYTES: Final = 1 << 26
"""Larger than any batch's header: a hundred trials with ten curves of fifty points take two megabytes."""


@dataclass(frozen=True)
class Header:
    """What a checkpoint says about itself.

    Attributes:
        condition: id of the trials' condition.
        platform: the device kind and versions that computed it; checkpoints of other platforms are ignored, since
            they would continue to other bits.
        batch: seeds that the batch was started with; they determine the widths of the batch over time.
        lanes: for each lane, the seed of its running trial, or None.
        chunks: whole chunks of the budget done; the state may be further.
        curves: for each seed (as text), the points of its training curve so far, by name.
        run_seconds: spent on running so far.
        processor_seconds: of processors' cores that running has taken so far.
        compile_seconds: spent on compiling by all processes that ran the batch.
        started: when the batch began (UTC, ISO 8601).
        versions: hash of the versions that the condition depends on (`packages.short_hash`).
        schema: version of this format.
        spent_seconds: of the time that a batch may take, so far; not counted without a limit.
    """

    condition: str
    platform: str
    batch: list[int]
    lanes: list[int | None]
    chunks: int
    curves: dict[str, dict[str, list[float]]]
    run_seconds: float
    compile_seconds: float
    started: str
    versions: str
    schema: int = SCHEMA
    processor_seconds: float = 0.0
    spent_seconds: float = 0.0

    @property
    def seeds(self) -> list[int]:
        """The seeds of the running trials."""
        return [seed for seed in self.lanes if seed is not None]


def path_of(folder: Path, header: Header) -> Path:
    """Return the path of a batch's checkpoint."""
    return folder / f"{header.condition}-{content_hash([header.batch, header.platform])[:16]}.npz"


def save(folder: Path, header: Header, state: TrialState) -> None:
    """Write header and state (on the host, leaves [lanes, …]) in one atomic step."""
    _write(folder, header, {f"{i:04d}": np.asarray(leaf) for i, leaf in enumerate(jax.tree.leaves(state))})


def _write(folder: Path, header: Header, arrays: Mapping[str, NDArray[Any]]) -> None:
    text = np.frombuffer(_text(header).encode(), dtype=np.uint8)
    write_atomically(path_of(folder, header), pack({**arrays, _HEADER: text}), ELSEWHERE)


def _text(header: Header) -> str:
    """Return a header as it is written; texts can be compared even if curves hold NaN."""
    return json.dumps(vars(header))


def find(folder: Path, condition: str, platform: str) -> list[Header]:
    """Return the headers of the checkpoints from which trials of `condition` can resume on this platform.

    Raises:
        DamagedFileError: when one of them is torn or edited.
    """
    found = [_header(path) for path in sorted(folder.glob(f"{condition}-*.npz"))]
    return [header for header in found if header is not None and header.platform == platform]


def sound_ones(folder: Path, condition: str) -> list[Header]:
    """Return the headers of a condition's checkpoints of every platform; skip those that are torn or edited."""
    headers: list[Header | None] = []
    for path in sorted(folder.glob(f"{condition}-*.npz")):
        with contextlib.suppress(DamagedFileError):
            headers.append(_header(path))
    return [header for header in headers if header is not None]


def renew(folder: Path, condition: str, seeds: Container[int]) -> None:
    """Let a condition's batches that have one of these seeds take all their time once more."""
    unusable = contextlib.suppress(FileNotFoundError, _OtherSchemaError, DamagedFileError)
    for path in sorted(folder.glob(f"{condition}-*.npz")):
        with unusable, _opened(path) as (header, packed):
            if header.spent_seconds and any(seed in seeds for seed in header.seeds):
                _write(folder, replace(header, spent_seconds=0.0), packed)


def newest(folder: Path, header: Header) -> Header | None:
    """Return the current header of a batch's checkpoint, or None when it is gone.

    A process that seemed dead (stopped for long, or on a machine with another clock) may have continued or finished
    the batch meanwhile.

    Raises:
        DamagedFileError: as for `find`.
    """
    return _header(path_of(folder, header))


def _header(path: Path) -> Header | None:
    """Return a checkpoint's header, or None when the file is gone or of another release; its state is not read."""
    try:
        with _opened(path) as (header, _):
            return header
    except (FileNotFoundError, _OtherSchemaError):
        return None


class _OtherSchemaError(Exception):
    """A checkpoint is of another release."""


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[tuple[Header, Packed]]:
    """Open a checkpoint and yield its header and its arrays, which can be read while it is open.

    Raises:
        DamagedFileError: when the file is torn, edited, misplaced or no checkpoint, also if that is found in the block.
        FileNotFoundError: when the file is gone.
        _OtherSchemaError: when another release has written it.
    """
    try:
        with open_file(path) as file:
            packed = Packed(file)
            if packed.nbytes(_HEADER) > _HEADER_BYTES:
                raise DamagedFileError(path, "its header is longer than that of any batch of trials")
            fields = json.loads(packed[_HEADER].tobytes())
            if fields.get("schema", SCHEMA) != SCHEMA:
                raise _OtherSchemaError(f"it has schema {fields['schema']}, not {SCHEMA}")
            header = convert(vars(Header(**fields)), Header)
            known = all(seed in header.batch for seed in header.seeds)  # as the runner relies on
            if not (known and is_hash(header.condition) and header.curves.keys() == set(map(str, header.batch))):
                raise DamagedFileError(path, "its header does not describe a batch of trials")
            if path.name != path_of(path.parent, header).name:
                raise DamagedFileError(path, "its name is not that of the batch it holds")
            yield header, packed
    except FileNotFoundError:
        raise
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise DamagedFileError(path, "it is not a readable checkpoint") from error


def restore(folder: Path, header: Header, like: Any) -> TrialState | None:
    """Return the state of a checkpoint on the host, in the structure of `like` (leaves with shape and dtype).

    None when the checkpoint no longer has this header: see `newest`.

    Raises:
        DamagedFileError: when the file is torn or edited.
        UserError: when its arrays do not fit `like`, which only the condition's program can tell.
    """
    path = path_of(folder, header)
    expected, structure = jax.tree.flatten(like)
    try:
        with _opened(path) as (there, packed):
            if _text(there) != _text(header):
                return None
            names = sorted(packed.kinds.keys() - {_HEADER})
            # Compare before reading: a file must not take more memory than the state it represents.
            if [packed.kinds[name] for name in names] != [(x.shape, x.dtype) for x in expected]:
                raise UserError(
                    f"Cannot continue from {path}: its arrays do not fit this condition's state, so "
                    "another version of the code made it. Delete it; its trials then start again."
                )
            state: TrialState = jax.tree.unflatten(structure, [packed[name] for name in names])
            return state
    except (FileNotFoundError, _OtherSchemaError):
        return None


def remove(folder: Path, header: Header) -> None:
    """Delete the checkpoint of a batch whose trials are all stored; on a read-only disk it stays, harmlessly."""
    with contextlib.suppress(OSError):
        path_of(folder, header).unlink(missing_ok=True)


def fault(path: Path) -> str | None:
    """Return why a checkpoint cannot be resumed, or None when it can (or is gone)."""
    try:
        with _opened(path) as (_, packed):
            return None if packed.is_whole() else "it is not a readable checkpoint"
    except FileNotFoundError:
        return None
    except _OtherSchemaError as error:
        return str(error)
    except DamagedFileError as error:
        return error.reason
