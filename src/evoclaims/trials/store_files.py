"""The files of a trial store: the mark by which it is recognized, their paths, and which of them belong to a trial."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from evoclaims.core.errors import UserError
from evoclaims.core.files import read_json, write_once
from evoclaims.core.packages import SHORT_HASH, Versions, short_hash
from evoclaims.trials.result_codec import checked_id

DEFAULT_ROOT: Final = Path(".evoclaims")

SPARE_DIGITS: Final = 16
"""Digits of a champion's hash in the name of a file beside the usual one."""

_RECORD: Final = re.compile(rf"([0-9a-f]{{64}})(?:\.([0-9a-f]{{{SHORT_HASH}}}))?\.json")


@dataclass(frozen=True)
class StoreFiles:
    """The names and paths of a store's files; this class opens none of them.

    Attributes:
        root: the folder; it need not exist yet.
    """

    root: Path = DEFAULT_ROOT

    @property
    def checkpoints(self) -> Path:
        """The folder of checkpoints of interrupted conditions."""
        return self.root / "checkpoints"

    def record_path(self, trial_id: str, versions: Versions | None = None) -> Path:
        """Return the path for a record of `trial_id`, made with `versions` of its packages or not naming them.

        A `UserError` says that a text is no id.
        """
        name = (
            f"{checked_id(trial_id, 'trial')}.json" if versions is None else f"{trial_id}.{short_hash(versions)}.json"
        )
        return self.root / "trials" / trial_id[:2] / name

    def record_files(self, trial_id: str) -> tuple[Path, ...]:
        """Return the files that may hold a record of `trial_id`, made with any versions."""
        usual = self.record_path(trial_id)
        return (usual, *(path for path in _entries(usual.parent) if path != usual and record_id(path) == trial_id))

    def may_have_records(self, trial_id: str) -> bool:
        """Whether anything is in the place of the folder of a trial's records; its entries take longer to look at."""
        return os.path.lexists(f"{self.root}/trials/{checked_id(trial_id, 'trial')[:2]}")

    def champion_path(self, trial_id: str) -> Path:
        """Return the path for the champion of `trial_id`; raise a `UserError` for a text that is not an id."""
        return self.root / "champions" / checked_id(trial_id, "trial")[:2] / f"{trial_id}.npz"

    def champion_files(self, trial_id: str) -> tuple[Path, ...]:
        """Return the files that hold a champion of `trial_id`; more than one if processes raced (see `put`)."""
        usual = self.champion_path(trial_id)
        found = (usual, *sorted(usual.parent.glob(f"{trial_id}.*.npz")))
        return tuple(path for path in found if os.path.exists(path))

    def spare_champion_path(self, trial_id: str, champion: str) -> Path:
        """Return the path for a champion when the usual place holds another one."""
        return self.champion_path(trial_id).with_suffix(f".{champion[:SPARE_DIGITS]}.npz")

    def record_paths(self) -> Iterator[Path]:
        """Iterate over all entries in the record folders, including strange ones, without hidden ones."""
        return _walk(self.root / "trials")

    def champion_paths(self) -> Iterator[Path]:
        """Iterate over all entries in the champion folders, including strange ones, without hidden ones."""
        return _walk(self.root / "champions")


def record_id(path: Path) -> str | None:
    """Return the trial id in the name of a record file; None for any other name."""
    named = _RECORD.fullmatch(path.name)
    return named[1] if named else None


def _walk(top: Path) -> Iterator[Path]:
    """Iterate over `top/<two hex digits>/*`, sorted; any other entry of `top` is yielded itself."""
    for entry in _entries(top):
        if re.fullmatch(r"[0-9a-f]{2}", entry.name) and entry.is_dir():
            yield from _entries(entry)
        else:
            yield entry


def _entries(folder: Path) -> list[Path]:
    """Return what is in `folder`, sorted; the folder itself when it cannot be listed."""
    try:
        names = sorted(os.listdir(folder))
    except FileNotFoundError:
        return []
    except OSError:
        return [folder]
    return [folder / name for name in names if not name.startswith(".")]


MARK: Final = "store.json"
SCHEMA: Final = 1
PROGRAM: Final = "evoclaims"

ELSEWHERE: Final = "name another folder with --claims-storage (pytest) or --storage (evoclaims)."
"""End of the error message when a store cannot be used."""

_OTHER: Final = "Name the folder of a store with --storage (evoclaims) or --claims-storage (pytest)"


def check_store(root: Path) -> None:
    """Reject an existing folder that is not a store: nothing may be read, written or moved in it.

    A folder is a store if it has the mark, and may become one if it is empty but for hidden files.

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
    held = sorted((name for name in names if not name.startswith(".")), key=lambda name: (name == "__pycache__", name))
    if held:
        raise UserError(
            f"{root} is not a trial store: it has no {MARK}, and {held[0]} is in it. Nothing in it was changed. "
            f"{_OTHER}. A new store needs a folder that is empty or does not exist."
        )


def mark(root: Path) -> None:
    """Mark a folder as a store, and make git ignore its contents.

    Raises:
        UserError: when the folder cannot be written or the disk is full.
    """
    if os.path.lexists(root / MARK):
        return
    text = json.dumps({"program": PROGRAM, "schema": SCHEMA, "content": "trials of claims; see `evoclaims --help`"})
    write_once(root / MARK, f"{text}\n".encode(), ELSEWHERE)
    write_once(root / ".gitignore", b"*\n", ELSEWHERE)


def _check_mark(path: Path) -> None:
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
