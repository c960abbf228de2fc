"""Files that are whole or absent: written aside, flushed, then renamed into place; and read without ever waiting."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from evoclaims.core.errors import UserError

ADVICE: Final = "Free some space or name another folder."


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


def write_atomically(path: Path, data: bytes, advice: str = ADVICE) -> None:
    """Write `data` to `path` so that a reader, or a kill at any moment, sees the old file or the new one.

    Args:
        path: of the file; folders on the way are made.
        data: all that it will hold.
        advice: a sentence for the user whose disk does not take it.

    Raises:
        UserError: when the folder cannot be written or the disk is full.
    """
    with _aside(path, data, advice) as aside:
        os.replace(aside, path)


def write_once(path: Path, data: bytes, advice: str = ADVICE) -> bool:
    """Write `data` to `path` as `write_atomically` does, unless something is there; return whether this call wrote it.

    Of processes that write at the same time exactly one does. On a file system without hard links the moment between
    looking and writing stays open.
    """
    if os.path.lexists(path):
        return False
    with _aside(path, data, advice) as aside:
        try:
            os.link(aside, path)
        except OSError:
            if os.path.lexists(path):
                return False
            os.replace(aside, path)
    return True


@contextlib.contextmanager
def _aside(path: Path, data: bytes, advice: str) -> Iterator[Path]:
    """Yield a temporary file beside `path` that holds `data` on disk; it is deleted after the block unless renamed."""
    aside = path.with_name(f".{path.name}.{os.getpid()}.{secrets.token_hex(4)}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(aside, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        yield aside
    except OSError as error:
        raise UserError(f"Cannot write {path}: {error.strerror or error}. {advice}") from error
    finally:
        with contextlib.suppress(OSError):  # a read-only disk refuses this too
            aside.unlink()
