"""What tells a store from any other folder: a small file in its root, or, of older stores, what lies in them."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Any, Final

from evoclaims.core.errors import UserError
from evoclaims.core.files import read_file, write_once

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
"""Folders of a store made before there was a mark, and what the names in them look like."""

ELSEWHERE: Final = "name another folder with --claims-storage (pytest) or --storage (evoclaims)."
"""The end of what a user is told whose store cannot be used."""
ADVICE: Final = f"Free some space or {ELSEWHERE}"

_OTHER: Final = "Name the folder of a store with --storage (evoclaims) or --claims-storage (pytest)"


def check_store(root: Path) -> None:
    """Refuse a folder that is there and is no store: nothing may be read from it, written to it or moved in it.

    A folder is a store when it has the mark, when it is empty, or when everything in it could have been put there by
    a release that did not write the mark yet.

    Raises:
        UserError: when it is something else, cannot be read, or is of a later release.
    """
    try:
        names = os.listdir(root)
    except FileNotFoundError:
        return
    except NotADirectoryError as error:
        if not os.path.exists(root):  # a folder on the way to it is a file: it is not there
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
            f"{root} is no trial store: it has no {MARK}, and a store has no {strange} in it. Nothing in it was "
            f"touched. {_OTHER}; a new one begins in a folder that is empty or not there yet."
        )


def mark(root: Path) -> None:
    """Mark a folder as a store, and tell git to ignore what is in it.

    An older store that has no mark yet gets no `.gitignore`: somebody may have committed its files.

    Raises:
        UserError: when the folder cannot be written or the disk is full.
    """
    if os.path.lexists(root / MARK):
        return
    begins = not any((root / name).exists() for name in _FOLDERS)
    text = json.dumps({"program": PROGRAM, "schema": SCHEMA, "content": "trials of claims; see `evoclaims --help`"})
    write_once(root / MARK, f"{text}\n".encode(), ADVICE)
    if begins:
        write_once(root / ".gitignore", b"*\n", ADVICE)


def _check_mark(path: Path) -> None:
    """Refuse a mark of another program or a later release."""
    try:
        plain: Any = json.loads(read_file(path))
    except (OSError, ValueError, RecursionError):
        plain = None
    if not isinstance(plain, dict) or plain.get("program") != PROGRAM:
        raise UserError(
            f"{path.parent} is no trial store: its {MARK} does not say so. {_OTHER}, or delete {path} if it was torn "
            "and this is one."
        )
    if plain.get("schema") != SCHEMA:
        raise UserError(
            f"{path} says schema {plain.get('schema')!r}, and this version of evoclaims knows stores of schema "
            f"{SCHEMA}: use a later version of evoclaims, or another folder."
        )


def _strange(root: Path, names: list[str]) -> str:
    """Return the first name in an unmarked folder that no store has, a user's own before Python's; empty when none."""
    for name in sorted(names, key=lambda name: (name == "__pycache__", name)):
        if name.startswith("."):
            continue
        pattern = _FOLDERS.get(name)
        if pattern is None or not (root / name).is_dir():
            return name
        try:
            inside = sorted(os.listdir(root / name))
        except OSError:
            continue  # an unreadable part of a store is told of where it is read
        for entry in inside:
            if not entry.startswith(".") and not re.fullmatch(pattern, entry):
                return f"{name}/{entry}"
    return ""
