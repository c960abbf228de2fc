"""Files whose contents are run, such as compiled programs: used only if no other user could have written them."""

from __future__ import annotations

import contextlib
import os
import stat
import warnings
from functools import cache
from pathlib import Path

from evoclaims.core.files import open_file


class ForeignFileError(OSError):
    """Another user may have written a file; the message is a clause that says why."""


def make_private(folder: Path) -> None:
    """Make a folder and its missing parents, into which only this user may write, whatever the umask.

    Raises:
        OSError: when one cannot be made.
    """
    for missing in reversed([one for one in (folder, *folder.parents) if not one.exists()]):
        with contextlib.suppress(FileExistsError):  # another process was faster
            missing.mkdir(mode=0o700)


def doubt(folder: Path) -> str:
    """Return a clause that says who else may write into a folder or exchange it, empty if only this user and root.

    Access lists and the owners of the folders above are not looked at.

    Raises:
        OSError: when the folder is missing or cannot be looked at.
    """
    if clause := _doubt(os.stat(folder)):
        return f"{folder} {clause}"
    for above in Path(os.path.realpath(folder)).parents:
        mode = os.stat(above).st_mode
        # Everybody could rename what is in it, and put another folder into its place; not with the sticky bit of /tmp.
        if mode & stat.S_IWOTH and not mode & stat.S_ISVTX and hasattr(os, "getuid"):
            return f"{above} is writable by all users"
    return ""


def read_private(path: Path) -> bytes:
    """Return the bytes of a regular file that only this user or root may have written.

    Raises:
        ForeignFileError: when another user owns it or may write it.
        OSError: as `read_file` does.
    """
    with open_file(path) as file:
        if clause := _doubt(os.fstat(file.fileno())):  # of the file that is read, whatever its name stands for by now
            raise ForeignFileError(f"it {clause}")
        return file.read()


@cache
def say_refused(path: Path, why: str) -> None:
    """Warn, at most once in a process, that compiled programs are not used: `why` is a clause on who may write them."""
    text = (
        f"Not using compiled programs in {path}: {why}, who could run any program here. They are compiled again. "
        "Use a cache folder that only you can write (XDG_CACHE_HOME), or remove the others' rights (chmod -R go-w)."
    )
    with contextlib.suppress(UserWarning):  # where warnings are errors: what is refused costs time alone
        warnings.warn(text, stacklevel=3)


def _doubt(status: os.stat_result) -> str:
    """Return a clause that says why other users may have written a file or folder."""
    if not hasattr(os, "getuid"):  # Windows has access lists instead
        return ""
    if status.st_uid not in (0, os.getuid()):
        return f"belongs to another user (uid {status.st_uid})"
    if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return f"is writable by other users (mode {stat.S_IMODE(status.st_mode):04o})"
    return ""
