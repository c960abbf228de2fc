"""Files that are whole or absent: written to a temporary file, flushed, then renamed; reading never blocks.

Files whose contents are run, such as compiled programs, are used only if no other user could have written them.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import io
import json
import os
import re
import secrets
import stat
import warnings
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO, Final

from evoclaims.core.errors import StorageError

ELSEWHERE: Final = "name another folder."
"""What a user can do about a file that cannot be written, if nothing else is known."""

MOST_BYTES: Final = 2**31
"""Of a file that is read as a whole: a larger one, such as one of holes alone, would take the memory."""

_FULL: Final = (errno.ENOSPC, errno.EDQUOT)
"""Errors of a disk or a quota that is full, where there is another way out."""


def open_file(path: Path) -> BinaryIO:
    """Open a regular file (or a link to one) for reading.

    Raises:
        OSError: when it is missing or unreadable; when it is a folder, or a pipe or device, which could block the
            reader forever.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    mode = os.fstat(descriptor).st_mode
    if not stat.S_ISREG(mode):
        os.close(descriptor)
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        raise OSError(errno.EINVAL, "it is not a regular file", str(path))
    return open(descriptor, "rb")


def read_file(path: Path) -> bytes:
    """Return the bytes of a file; raises as `open_file` does, and for one of more than `MOST_BYTES`."""
    with open_file(path) as file:
        if os.fstat(file.fileno()).st_size > MOST_BYTES:
            raise OSError(errno.EFBIG, os.strerror(errno.EFBIG), str(path))
        return file.read()


def read_json(path: Path) -> Any:
    """Return what a file holds as JSON.

    Raises:
        OSError: as `read_file` does.
        ValueError: when it is not JSON, or nested too deeply.
    """
    try:
        return json.loads(read_file(path))
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error


def read_text(path: Path) -> str:
    """Return a UTF-8 text, with each end of a line as a line feed.

    Raises:
        OSError: as `read_file` does.
        ValueError: when it is not UTF-8.
    """
    return io.StringIO(read_file(path).decode(), newline=None).read()


def write_atomically(path: Path, data: bytes, elsewhere: str = ELSEWHERE, mode: int = 0o666) -> None:
    """Write `data` to `path`; a reader always sees the whole old file or the whole new one, even after a kill.

    Missing parent folders are created. `elsewhere` is the end of the sentence that says how to write to another place.
    `mode` is the new file's, less what the umask forbids.

    Raises:
        StorageError: when the folder cannot be written or the disk is full.
    """
    with _aside(path, data, elsewhere, mode) as aside:
        os.replace(aside, path)


def write_once(path: Path, data: bytes, elsewhere: str = ELSEWHERE) -> bool:
    """Write `data` to `path` as `write_atomically` does, unless the path exists; return whether this call wrote it.

    If several processes write at once, exactly one succeeds. Without hard links in the file system, a race between
    the check and the write remains.
    """
    if os.path.lexists(path):
        return False
    with _aside(path, data, elsewhere) as aside:
        try:
            os.link(aside, path)
        except OSError:
            if os.path.lexists(path):
                return os.path.samestat(os.lstat(aside), os.lstat(path))  # NFS may lose the reply to a link it made
            os.replace(aside, path)
    return True


def at_once(path: str, flags: int) -> int:
    """Open a file for writing: an `opener` of `open`, by which a pipe that nobody reads is an error and no wait."""
    return os.open(path, flags | os.O_NONBLOCK, 0o666)


def write_where_named(path: Path, data: bytes, elsewhere: str = ELSEWHERE) -> None:
    """Write `data` to what a user has named: through a link, or straight into a device or pipe such as /dev/stdout.

    Any other path is written as by `write_atomically`, whose file would replace a link or device.

    Raises:
        StorageError: when it cannot be written; also for a pipe that nobody reads, where a writer could wait forever.
    """
    try:
        is_file = stat.S_ISREG(os.stat(path).st_mode)
    except OSError:  # not there yet
        is_file = True
    if is_file:
        write_atomically(Path(os.path.realpath(path)) if os.path.islink(path) else path, data, elsewhere)
        return
    try:
        with open(os.open(path, os.O_WRONLY | os.O_NONBLOCK), "wb") as file:
            os.set_blocking(file.fileno(), True)
            file.write(data)
    except OSError as error:
        raise _unwritten(path, error, elsewhere) from error


@contextlib.contextmanager
def _aside(path: Path, data: bytes, elsewhere: str, mode: int = 0o666) -> Iterator[Path]:
    """Yield a temporary file beside `path` with `data` on disk; it is deleted after the block unless renamed."""
    aside = path.with_name(f".{path.name}.{os.getpid()}.{secrets.token_hex(4)}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(aside, "wb", opener=lambda name, flags: os.open(name, flags, mode)) as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        yield aside
    except OSError as error:
        raise _unwritten(path, error, elsewhere) from error
    finally:
        with contextlib.suppress(OSError):  # fails too on a read-only disk
            aside.unlink()


def _unwritten(path: Path, error: OSError, elsewhere: str) -> StorageError:
    way = f"Free some space, or {elsewhere}" if error.errno in _FULL else f"{elsewhere[0].upper()}{elsewhere[1:]}"
    return StorageError(f"Cannot write {path}: {error.strerror or error}. {way}")


LONGEST: Final = 120
"""Most characters in a name; file systems allow 255 bytes, and suffixes and temporary names need some."""

_HASH_DIGITS: Final = 16
_WORD: Final = r"[A-Za-z0-9_][A-Za-z0-9_.]*"
_PLAIN: Final = re.compile(rf"{_WORD}(-[A-Za-z0-9_.-]+)?")


def file_name(first: str, second: str = "") -> str:
    """Return a name, without a suffix, for one text or two: "G1-n_parity" for "G1" and "n_parity".

    A name that would be ambiguous (characters dropped, text cut short, or a dash in the first text) ends in "~" and
    a hash of both texts; no other name contains a "~".
    """
    joined = f"{first}-{second}" if second else first
    if "-" not in first and len(joined) <= LONGEST and _PLAIN.fullmatch(joined):
        return joined
    slug = re.sub(r"[^A-Za-z0-9_.-]+", "-", joined).strip("-.") or "_"
    # The length of the first text says where it ends, so two pairs never hash the same text.
    whole = f"{len(first)}:{first}{second}".encode("utf-8", errors="surrogatepass")
    mark = f"~{hashlib.sha256(whole).hexdigest()[:_HASH_DIGITS]}"
    return f"{slug[: LONGEST - len(mark)]}{mark}"


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
        if mode & stat.S_IWOTH and not mode & stat.S_ISVTX:
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
    if status.st_uid not in (0, os.getuid()):
        return f"belongs to another user (uid {status.st_uid})"
    if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return f"is writable by other users (mode {stat.S_IMODE(status.st_mode):04o})"
    return ""
