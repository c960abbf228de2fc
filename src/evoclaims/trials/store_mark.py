"""How a store is recognized: by a small file in its root or, for older stores, by their contents."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Any, Final

from evoclaims.core.errors import UserError
from evoclaims.core.files import read_json, write_once

MARK: Final = "store.json"
SCHEMA: Final = 1
PROGRAM: Final = "evoclaims"

_FOLDERS: Final = {
    "trials": r"[0-9a-f]{2}",
    "champions": r"[0-9a-f]{2}",
    "checkpoints": r"[0-9a-f]{64}-[0-9a-f]{16}\.npz",
    "running": r"[0-9a-f]{64}\.json",
    "verdicts": r".+",
    "quarantine": r".+",
}
"""Folders of a store from before the mark existed, with the pattern of the names in them."""

ELSEWHERE: Final = "name another folder with --claims-storage (pytest) or --storage (evoclaims)."
"""End of the error message when a store cannot be used."""

_OTHER: Final = "Name the folder of a store with --storage (evoclaims) or --claims-storage (pytest)"


def check_store(root: Path) -> None:
    """Reject an existing folder that is not a store: nothing may be read, written or moved in it.

    A folder is a store if it has the mark, is empty, or contains only what a release without the mark could have
    written.

    Raises:
        UserError: when it is something else, cannot be read, or is of a later release.
    """
    try:
        names = os.listdir(root)
    except FileNotFoundError:
        return
    except NotADirectoryError as error:
        if not os.path.exists(root):  # a parent is a file, so the folder does not exist
            return
        raise UserError(f"The trial store {root} is a file, not a folder: {ELSEWHERE}") from error
    except OSError as error:
        raise UserError(f"The trial store {root} cannot be read: {error.strerror or error}. {_OTHER}.") from error
    if MARK in names:
        _check_mark(root / MARK)
        return
    strange = _strange(root, names)
    if strange:
        raise UserError(
            f"{root} is not a trial store: it has no {MARK}, and a store has no {strange} in it. Nothing "
            f"in it was changed. {_OTHER}. A new store needs a folder that is empty or does not exist."
        )


def mark(root: Path) -> None:
    """Mark a folder as a store, and make git ignore its contents.

    An older store without a mark gets no `.gitignore`: its files may have been committed.

    Raises:
        UserError: when the folder cannot be written or the disk is full.
    """
    if os.path.lexists(root / MARK):
        return
    begins = not any((root / name).exists() for name in _FOLDERS)
    text = json.dumps({"program": PROGRAM, "schema": SCHEMA, "content": "trials of claims; see `evoclaims --help`"})
    write_once(root / MARK, f"{text}\n".encode(), ELSEWHERE)
    if begins:
        write_once(root / ".gitignore", b"*\n", ELSEWHERE)


def _check_mark(path: Path) -> None:
    """Reject a mark of another program or a later release."""
    try:
        plain: Any = read_json(path)
    except (OSError, ValueError):
        plain = None
    if not isinstance(plain, dict) or plain.get("program") != PROGRAM:
        raise UserError(
            f"{path.parent} is not a trial store: its {MARK} was not written by {PROGRAM}. {_OTHER}. If "
            f"the folder is a store whose {MARK} was torn, delete {path}."
        )
    if plain.get("schema") != SCHEMA:
        raise UserError(
            f"{path} has schema {plain.get('schema')!r}, and this version of evoclaims reads schema "
            f"{SCHEMA}. Use a later version of evoclaims, or another folder."
        )


def _strange(root: Path, names: list[str]) -> str:
    """Return the first name in an unmarked folder that no store has, Python's own names last; empty if none."""
    for name in sorted(names, key=lambda name: (name == "__pycache__", name)):
        if name.startswith("."):
            continue
        pattern = _FOLDERS.get(name)
        if pattern is None or not (root / name).is_dir():
            return name
        try:
            inside = sorted(os.listdir(root / name))
        except OSError:
            continue  # an unreadable part of a store is reported where it is read
        for entry in inside:
            if not entry.startswith(".") and not re.fullmatch(pattern, entry):
                return f"{name}/{entry}"
    return ""
