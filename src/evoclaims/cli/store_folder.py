"""Which folder a command's store is in: the one that --storage names, or the project's own."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

from evoclaims.core.errors import UserError
from evoclaims.paper.config import find_root
from evoclaims.trials.store import Store
from evoclaims.trials.store_files import DEFAULT_ROOT

BEGINNING: Final = frozenset({"run", "submit", "mutants", "power", "across", "bisect", "merge"})
"""Commands that create a missing store; the others read one."""

APART: Final = {"across": ".evoclaims-releases", "bisect": ".evoclaims-releases"}
"""Stores of a project for commands that would fill its usual one with trials and verdicts of other environments."""


def storage_of(named: str | None, command: str) -> str:
    """Return the folder of a command's store, relative to the current one if it was named so.

    Args:
        named: as --storage says; None for the store in the root of the project around the current folder (a fresh
            clone has none yet).
        command: the command's name.

    Raises:
        UserError: for an empty name, and when a command that only reads finds no folder there.
    """
    if named is None:
        return os.path.relpath(_project() / APART.get(command, DEFAULT_ROOT))
    if not named:
        raise UserError("--storage names no folder. Name one, or leave it out for the project's own store.")
    if command not in BEGINNING and not os.path.lexists(named):
        raise UserError(
            f"There is no trial store {named}: the folder does not exist. Check its name, or leave --storage out for "
            "the project's own store."
        )
    return named


def open_store(name: str) -> Store:
    """Return the store in the folder `name`, relative to the current one.

    Raises:
        UserError: when it exists but is not a store.
    """
    store = Store(Path(name))
    store.check()
    return store


def _project() -> Path:
    """Return the root of the project around the current folder; the folder itself outside a project."""
    try:
        return find_root(Path.cwd())
    except UserError:
        return Path.cwd()
