"""Files that are whole or absent: written aside, flushed, then renamed into place."""

from __future__ import annotations

import contextlib
import os
import secrets
from pathlib import Path

from evoclaims.core.errors import UserError


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
