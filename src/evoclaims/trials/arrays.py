"""Named arrays as npz bytes: the same arrays give the same bytes, and nothing is ever pickled."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

_EPOCH = (1980, 1, 1, 0, 0, 0)
_UNIX = 3


def pack(arrays: Mapping[str, Any]) -> bytes:
    """Return `arrays` (any shapes) as an npz file whose bytes depend on names and values only.

    `numpy.savez` stamps the time into the file, so that two processes storing the same champion would disagree
    about its hash.

    Raises:
        ValueError: for an array of objects, or of a type that npz cannot name (such as bfloat16).
    """
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        for name in sorted(arrays):
            array = np.asarray(arrays[name], order="C")
            if array.dtype.kind in "OV":
                raise ValueError(f"The array {name!r} has type {array.dtype}, which npz cannot hold without pickle.")
            entry = zipfile.ZipInfo(f"{name}.npy", date_time=_EPOCH)
            entry.create_system = _UNIX
            with archive.open(entry, "w", force_zip64=True) as member:
                np.lib.format.write_array(member, array, allow_pickle=False)
    return file.getvalue()


def unpack(data: bytes) -> dict[str, NDArray[Any]]:
    """Return the arrays in the npz file `data`.

    Raises:
        ValueError: when `data` is not such a file, or would need pickle.
    """
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except Exception as error:  # bytes of unknown origin fail in many ways: zip, zlib, header, memory
        raise ValueError(f"not a readable npz file ({type(error).__name__})") from error
