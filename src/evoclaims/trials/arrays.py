"""Named arrays as npz bytes: equal arrays give equal bytes, and nothing is ever pickled or unpickled."""

from __future__ import annotations

import io
import math
import zipfile
from collections.abc import Iterator, Mapping
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

_EPOCH = (1980, 1, 1, 0, 0, 0)
_UNIX = 3
_SUFFIX = ".npy"
_HEADERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}

Kind = tuple[tuple[int, ...], np.dtype[Any]]
"""Shape and dtype of an array."""


def pack(arrays: Mapping[str, Any]) -> bytes:
    """Return `arrays` (any shapes) as an npz file whose bytes depend only on names and values.

    `numpy.savez` writes the time into the file, so two processes that store the same champion would get different
    hashes.

    Raises:
        ValueError: for an array of objects, or of a type that npz does not support (such as bfloat16).
    """
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        for name in sorted(arrays):
            array = np.asarray(arrays[name], order="C")
            if array.dtype.kind in "OV":
                raise ValueError(f"The array {name!r} has type {array.dtype}, which npz cannot hold without pickle.")
            entry = zipfile.ZipInfo(f"{name}{_SUFFIX}", date_time=_EPOCH)
            entry.create_system = _UNIX
            with archive.open(entry, "w", force_zip64=True) as member:
                np.lib.format.write_array(member, array, allow_pickle=False)
    return file.getvalue()


def unpack(data: bytes) -> dict[str, NDArray[Any]]:
    """Return the arrays in the npz file `data`.

    Raises:
        ValueError: when `data` is not such a file, or would need pickle.
    """
    return dict(Packed(io.BytesIO(data)))


class Packed(Mapping[str, NDArray[Any]]):
    """The arrays of an npz file written by `pack`, each read only on request.

    A file of unknown origin may claim arrays of any size, or hold gigabytes in a few compressed bytes. Here nothing is
    compressed and no array is larger than its part of the file; this is checked before any memory is allocated.
    """

    def __init__(self, file: IO[bytes]) -> None:
        """Read the headers of the arrays; the file must stay open while arrays are read.

        Raises:
            ValueError: when it is not such a file.
        """
        try:
            self._archive = zipfile.ZipFile(file)
            entries = self._archive.infolist()
            if sum(entry.file_size for entry in entries) > file.seek(0, io.SEEK_END):
                raise ValueError("its parts are longer than the file")
            self.kinds: Mapping[str, Kind] = {
                entry.filename.removesuffix(_SUFFIX): self._kind(entry) for entry in entries
            }
        except Exception as error:  # unknown bytes fail in many ways: zip, struct, header, memory
            raise ValueError(f"not a readable npz file ({type(error).__name__})") from error

    def _kind(self, entry: zipfile.ZipInfo) -> Kind:
        """Return shape and dtype of an array; raise a ValueError if its part of the file has another length."""
        if entry.compress_type != zipfile.ZIP_STORED or not entry.filename.endswith(_SUFFIX):
            raise ValueError("a part of it is not an array as it is")
        with self._archive.open(entry) as member:
            shape, _, dtype = _HEADERS[np.lib.format.read_magic(member)](member)
            if dtype.hasobject or member.tell() + math.prod(shape) * dtype.itemsize != entry.file_size:
                raise ValueError("an array is not as long as it claims")
        return shape, dtype

    def nbytes(self, name: str) -> int:
        """Return how much memory an array takes."""
        shape, dtype = self.kinds[name]
        return math.prod(shape) * dtype.itemsize

    def is_whole(self) -> bool:
        """Whether every byte matches the file's checksums; uses little memory for files of any length."""
        try:
            return self._archive.testzip() is None
        except Exception:  # as above
            return False

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Read an array.

        Raises:
            KeyError: for an unknown name.
            ValueError: when it does not match its checksum.
        """
        self.kinds[name]
        try:
            with self._archive.open(name + _SUFFIX) as member:
                array: NDArray[Any] = np.lib.format.read_array(member, allow_pickle=False)
        except Exception as error:  # as above
            raise ValueError(f"not a readable npz file ({type(error).__name__})") from error
        return array

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names."""
        return iter(self.kinds)

    def __len__(self) -> int:
        """Return the number of arrays."""
        return len(self.kinds)
