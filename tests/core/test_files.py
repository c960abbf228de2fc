"""A file is the old one or the new one, whatever goes wrong in between."""

from __future__ import annotations

import errno
import os
import threading
from pathlib import Path
from typing import Any

import pytest

from evoclaims.core.errors import UserError
from evoclaims.core.files import write_atomically, write_where_named

FAULTS = {"the disk is full": errno.ENOSPC, "the disk is read-only": errno.EROFS, "the disk fails": errno.EIO}


@pytest.fixture(params=FAULTS.values(), ids=list(FAULTS))
def fault(request: pytest.FixtureRequest) -> OSError:
    return OSError(request.param, os.strerror(request.param))


def _raising(error: OSError) -> Any:
    def function(*_: Any, **__: Any) -> None:
        raise error

    return function


def test_missing_folders_are_made_and_nothing_else_is_left(tmp_path: Path) -> None:
    path = tmp_path / "a" / "b" / "file.json"
    for data in (b"one", b"", b"two\r\n\x00"):
        write_atomically(path, data)
        assert path.read_bytes() == data
    assert list(path.parent.iterdir()) == [path]


def test_a_file_in_the_place_of_a_folder_or_a_folder_in_its_own_stays_and_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("a file")
    (tmp_path / "folder").mkdir()
    for path in (tmp_path / "file" / "new", tmp_path / "folder"):
        with pytest.raises(UserError, match="Cannot write"):
            write_atomically(path, b"new")
    assert sorted(tmp_path.iterdir()) == [tmp_path / "file", tmp_path / "folder"]


@pytest.mark.parametrize("call", ["os.fsync", "os.replace", "builtins.open"])
def test_a_failing_disk_leaves_the_old_file_and_no_leftovers(
    call: str, fault: OSError, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "file"
    write_atomically(path, b"old")
    monkeypatch.setattr(call, _raising(fault))
    with pytest.raises(UserError, match=rf"^Cannot write .*file: {fault.strerror}\. .*[Bb]uy a larger one\.$"):
        write_atomically(path, b"new", "buy a larger one.")
    monkeypatch.undo()
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_read_only_disk_that_refuses_even_the_clean_up_is_still_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    error = OSError(errno.EROFS, os.strerror(errno.EROFS))
    monkeypatch.setattr(os, "replace", _raising(error))
    monkeypatch.setattr(Path, "unlink", _raising(error))
    with pytest.raises(UserError, match="Read-only file system"):
        write_atomically(tmp_path / "file", b"new")


def test_the_new_file_is_whole_before_it_has_the_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, seen = tmp_path / "file", []
    rename = os.replace

    def watched(source: Path, target: Path) -> None:
        seen.append((Path(source).read_bytes(), path.exists(), Path(source).parent == path.parent))
        rename(source, target)

    monkeypatch.setattr(os, "replace", watched)
    write_atomically(path, b"whole")
    assert seen == [(b"whole", False, True)]


def test_what_a_user_has_named_is_written_through_links_and_into_pipes_which_stay(tmp_path: Path) -> None:
    file, link, pipe = (tmp_path / name for name in ("file", "link", "pipe"))
    file.write_bytes(b"old")
    link.symlink_to(file)
    write_where_named(link, b"new")
    assert (link.is_symlink(), file.read_bytes()) == (True, b"new")
    os.mkfifo(pipe)
    with pytest.raises(UserError, match=f"^Cannot write {pipe}: "):
        write_where_named(pipe, b"nobody reads")
    read: list[bytes] = []
    long = bytes(1 << 20)
    reader = threading.Thread(target=lambda: read.append(pipe.read_bytes()))
    reader.start()
    while reader.is_alive():
        try:
            write_where_named(pipe, long)
        except UserError:  # the reader has not opened it yet
            continue
        reader.join(10)
    assert (read, pipe.is_fifo()) == ([long], True)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="Linux has a device that is a full disk")
def test_a_device_that_a_user_has_named_is_not_replaced_by_a_file(tmp_path: Path) -> None:
    device = tmp_path / "device"
    device.symlink_to("/dev/full")
    with pytest.raises(UserError, match="No space left on device"):
        write_where_named(device, b"data")
    assert device.is_symlink()
    assert Path("/dev/full").is_char_device()


@pytest.mark.parametrize(("fault", "way"), [(errno.ENOSPC, "Free some space, or name"), (errno.EROFS, "Name")])
def test_only_on_a_full_disk_space_is_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: int, way: str
) -> None:
    def refuse(descriptor: int) -> None:
        raise OSError(fault, os.strerror(fault))

    monkeypatch.setattr(os, "fsync", refuse)
    with pytest.raises(UserError, match=rf"Cannot write .*: {os.strerror(fault)}\. {way} another folder\.$"):
        write_atomically(tmp_path / "file", b"data")
