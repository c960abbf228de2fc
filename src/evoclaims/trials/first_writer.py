"""Files that the first of several writers keeps."""

from __future__ import annotations

import contextlib
import os
import secrets
from pathlib import Path

from evoclaims.core.files import write_atomically


def write_once(path: Path, data: bytes) -> bool:
    """Write `data` to `path`, whole at once, unless something lies there already; return whether this call wrote it.

    Of processes that write at the same time exactly one does. On a file system without hard links the moment between
    looking and writing stays open.

    Raises:
        UserError: when the folder cannot be written or the disk is full.
    """
    if os.path.lexists(path):
        return False
    aside = path.with_name(f".{path.name}.{os.getpid()}.{secrets.token_hex(4)}.tmp")
    write_atomically(aside, data)
    try:
        os.link(aside, path)
    except FileExistsError:
        return False
    except OSError:
        if os.path.lexists(path):
            return False
        write_atomically(path, data)
    finally:
        with contextlib.suppress(OSError):
            aside.unlink()
    return True
