"""Interrupted batches: the whole state of some trials at a chunk's end, from which they go on to the same bits."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import jax
import numpy as np
from numpy.typing import NDArray

from evoclaims.core.canonical import content_hash
from evoclaims.core.files import write_atomically
from evoclaims.trials.arrays import pack, unpack
from evoclaims.trials.program import TrialState
from evoclaims.trials.store import DamagedFileError

SCHEMA: Final = 1
_HEADER: Final = "header"


@dataclass(frozen=True)
class Header:
    """What a checkpoint says about itself.

    Attributes:
        condition: id of the trials' condition.
        platform: what it was computed on and with (device kind and versions): other hardware would go on to other
            bits, so that such a checkpoint is passed over.
        batch: seeds that the batch was started with; it fixes the widths the batch goes through.
        lanes: for each lane, the seed whose record is still owed, or None.
        chunks: chunks of the budget done.
        curves: for each seed (as text), the points of its training curve so far, by name.
        run_seconds: spent on running so far.
        compile_seconds: spent on compiling by the processes that had the batch before.
        started: when the batch began (UTC, ISO 8601).
        schema: version of this format.
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
    schema: int = SCHEMA


def path_of(folder: Path, condition: str, batch: list[int], platform: str) -> Path:
    """Return where the checkpoint of a batch lies."""
    return folder / f"{condition}-{content_hash([batch, platform])[:16]}.npz"


def save(folder: Path, header: Header, state: TrialState) -> None:
    """Write header and state (on the host, leaves [lanes, …]) in one atomic step."""
    arrays = {f"{i:04d}": np.asarray(leaf) for i, leaf in enumerate(jax.tree.leaves(state))}
    arrays[_HEADER] = np.frombuffer(json.dumps(asdict(header)).encode(), dtype=np.uint8)
    write_atomically(path_of(folder, header.condition, header.batch, header.platform), pack(arrays))


def find(folder: Path, condition: str, platform: str) -> list[Header]:
    """Return the headers of the checkpoints that trials of `condition` can go on from on this platform.

    Raises:
        DamagedFileError: when one of them is torn or edited.
    """
    headers = [read(path)[0] for path in sorted(folder.glob(f"{condition}-*.npz"))]
    return [h for h in headers if h.condition == condition and h.platform == platform and h.schema == SCHEMA]


def read(path: Path) -> tuple[Header, list[NDArray[Any]]]:
    """Return a checkpoint's header and the leaves of its state.

    Raises:
        DamagedFileError: when the file is torn, edited or not a checkpoint.
    """
    try:
        arrays = unpack(path.read_bytes())
        header = Header(**json.loads(arrays.pop(_HEADER).tobytes()))
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DamagedFileError(path, "it is not a readable checkpoint") from error
    return header, [arrays[name] for name in sorted(arrays)]


def restore(folder: Path, header: Header, like: Any) -> TrialState:
    """Return the state of a checkpoint on the host, in the structure of `like` (leaves with shape and dtype).

    Raises:
        DamagedFileError: when its arrays are not those of such a state.
    """
    path = path_of(folder, header.condition, header.batch, header.platform)
    _, leaves = read(path)
    expected, structure = jax.tree.flatten(like)
    if [(x.shape, x.dtype) for x in leaves] != [(x.shape, x.dtype) for x in expected]:
        raise DamagedFileError(path, "its arrays are not those of this condition's state")
    state: TrialState = jax.tree.unflatten(structure, leaves)
    return state


def remove(folder: Path, header: Header) -> None:
    """Delete the checkpoint of a batch whose trials are all stored."""
    path_of(folder, header.condition, header.batch, header.platform).unlink(missing_ok=True)


def fault(path: Path) -> str | None:
    """Return why a checkpoint cannot be gone on from, or None when it can."""
    try:
        header, _ = read(path)
    except DamagedFileError as error:
        return error.reason
    return None if header.schema == SCHEMA else f"it has schema {header.schema}, not {SCHEMA}"
