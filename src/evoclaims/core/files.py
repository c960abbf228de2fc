"""Files that are whole or absent: written aside, flushed, then renamed into place; and read without ever waiting."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import stat
from pathlib import Path

from evoclaims.core.errors import UserError


def read_file(path: Path) -> bytes:
    """Return the bytes of a regular file (also by a link to one).

    Raises:
        OSError: when it is not there or cannot be read; when it is a folder, or a pipe or device, from which a reader
            would wait for ever.
    """
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    mode = os.fstat(descriptor).st_mode
    if not stat.S_ISREG(mode):
        os.close(descriptor)
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        raise OSError(errno.EINVAL, "it is no regular file", str(path))
    with open(descriptor, "rb") as file:
        return file.read()


def write_atomically(path: Path, data: bytes) -> None:
    """Write `data` to `path` so that a reader, or a kill at any moment, sees the old file or the new one.

    Raises:
        UserError: when the folder cannot be written or the disk is full.
    """
    aside = path.with_name(f".{path.name}.{os.getpid()}.{secrets.token_hex(4)}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(aside, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(aside, path)
    except OSError as error:
        with contextlib.suppress(OSError):  # a read-only disk refuses this too
            aside.unlink()
        raise UserError(
            f"Cannot write {path}: {error.strerror or error}. Free some space or name another folder "
            "with --claims-storage (pytest) or --storage (evoclaims)."
        ) from error
