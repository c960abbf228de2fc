"""Checking a whole store: read every record and champion, list leftovers, move bad files aside."""

from __future__ import annotations

import dataclasses
import itertools
import os
import re
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from evoclaims.core.errors import UserError
from evoclaims.core.printable import printable
from evoclaims.trials.store import DamagedFileError, Store
from evoclaims.trials.store_files import SPARE_DIGITS, record_id

SETTLED_SECONDS: Final = 60.0
"""A half-written file younger than this may belong to a running process, so it is not a leftover yet."""

_CHAMPION: Final = re.compile(rf"[0-9a-f]{{64}}(\.[0-9a-f]{{{SPARE_DIGITS}}})?\.npz")

Kind = Literal["record", "champion", "checkpoint", "leftover"]


@dataclass(frozen=True)
class Problem:
    """One file with a problem.

    Attributes:
        path: the file.
        kind: "record", "champion" or "checkpoint" for a bad one; "leftover" for harmless remains of a kill.
        reason: a clause that says what is wrong.
        moved_to: where the repair moved the file, or None.
        stays: whether a repair leaves it where it is, since a later release reads it.
    """

    path: Path
    kind: Kind
    reason: str
    moved_to: Path | None = None
    stays: bool = False

    def __str__(self) -> str:
        """Return one line for the terminal."""
        moved = f" (moved to {self.moved_to})" if self.moved_to else " (left there)" * self.stays
        return printable(f"{self.kind} {self.path}: {self.reason}{moved}")


def verify(store: Store, repair: bool) -> list[Problem]:
    """Read everything in `store` and list the problems.

    Args:
        store: the store; one that does not exist yet has no problems.
        repair: move listed files, except those of a later release, into `<root>/quarantine/`; nothing is ever deleted.

    Returns:
        One problem per file, records first.

    Raises:
        UserError: when the folder is not a store (nothing is moved then), or a bad file cannot be moved.
    """
    store.check()
    checks = (_records(store), _champions(store), _checkpoints(store), _leftovers(store))
    found: dict[Path, Problem] = {}
    for problem in itertools.chain.from_iterable(checks):
        found.setdefault(problem.path, problem)
    problems = sorted(found.values(), key=lambda problem: (_ORDER[problem.kind], problem.path))
    if not repair:
        return problems
    return [
        problem if problem.stays else dataclasses.replace(problem, moved_to=_set_aside(store, problem.path))
        for problem in problems
    ]


_ORDER: Final[dict[Kind, int]] = {"record": 0, "champion": 1, "checkpoint": 2, "leftover": 3}


def _records(store: Store) -> Iterator[Problem]:
    """Check every record together with its champion: neither is useful without the other."""
    for path in store.record_paths():
        try:
            result = store.read(path)
        except DamagedFileError as error:
            yield Problem(path, "record", error.reason, stays=error.later)
            trial_id = record_id(path)
            if not error.later and trial_id and path.parent == store.record_path(trial_id).parent:
                for champion in sorted({*store.champion_files(trial_id)} - _named(store, trial_id)):
                    yield Problem(champion, "champion", "its trial's record cannot be used")
            continue
        if result is None:
            continue
        try:
            store.whole_champion(path, result)
        except DamagedFileError as error:
            if error.path == path:
                yield Problem(path, "record", error.reason)
                continue
            yield Problem(path, "record", "its champion cannot be used, so the trial has to be run again")
            if error.path.exists():
                yield Problem(error.path, "champion", error.reason)


def _named(store: Store, trial_id: str) -> set[Path]:
    """Return the champions that a trial's records name; all of its own if a record is of a later release."""
    errors: list[DamagedFileError] = []
    records = list(store.results(errors, store.record_files(trial_id)))
    if any(error.later for error in errors):
        return {*store.champion_files(trial_id)}
    return {store.champion_file(result) for result in records if result.champion}


def _champions(store: Store) -> Iterator[Problem]:
    """Find champions without a record: foreign ones, and those of a run killed between writing the two files."""
    for path in store.champion_paths():
        trial_id = path.name.partition(".")[0]
        if not _CHAMPION.fullmatch(path.name) or path.parent != store.champion_path(trial_id).parent:
            yield Problem(path, "champion", "its name or place is not that of a champion")
        elif not any(map(os.path.lexists, store.record_files(trial_id))) and _settled(path):
            yield Problem(path, "leftover", "it has no record, so its run was stopped before the trial was stored")
        elif len(store.champion_files(trial_id)) > 1 and path not in _named(store, trial_id) and _settled(path):
            yield Problem(path, "leftover", "no record of its trial names it")


def _checkpoints(store: Store) -> Iterator[Problem]:
    for path in sorted(store.checkpoints.rglob("*")):
        if path.is_file() and not path.name.startswith("."):
            from evoclaims.trials.checkpoint import fault  # it imports jax

            if (reason := fault(path)) is not None:
                yield Problem(path, "checkpoint", printable(reason))


def _leftovers(store: Store) -> Iterator[Problem]:
    """Find files that a kill left half-written, and leases of processes that no longer run."""
    for path in sorted(store.root.rglob(".*.tmp")):
        if _quarantine(store) not in path.parents and _settled(path):
            yield Problem(path, "leftover", "its writer was stopped before the file was whole")
    for path in sorted((store.root / "running").glob("*")):
        beside = (path, path.with_suffix(".lock"))  # a running process refreshes its lease
        if not path.name.startswith(".") and all(_settled(one) for one in beside if one.exists()):
            yield Problem(path, "leftover", "the process that it announces is no longer at work")


def _settled(path: Path) -> bool:
    """Whether `path` is so old that no process can still be writing it."""
    try:
        return time.time() - path.lstat().st_mtime > SETTLED_SECONDS
    except OSError:
        return False


def _quarantine(store: Store) -> Path:
    return store.root / "quarantine"


def _set_aside(store: Store, path: Path) -> Path | None:
    """Move `path` into the quarantine under a free name; None when it is already gone."""
    folder = _quarantine(store)
    name = path.name.lstrip(".")
    target, count = folder / name, 0
    while os.path.lexists(target):
        count += 1
        target = folder / f"{name}.{count}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        os.rename(path, target)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise UserError(f"Cannot move {path} to {folder}: {error.strerror or error}; move it by hand.") from error
    return target
