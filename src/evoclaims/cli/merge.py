"""`evoclaims merge`: trials and champions of other stores, copied into one; claims are judged anew from them."""

from __future__ import annotations

import argparse
import os
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from evoclaims.cli.store_folder import open_store
from evoclaims.core.canonical import canonical_json
from evoclaims.core.errors import UserError
from evoclaims.core.printable import printable
from evoclaims.trials.result import COMPLETE, TrialResult
from evoclaims.trials.store import DamagedFileError, Store, gives_way

Fate = Literal["copied", "there", "differs", "damaged"]
"""What became of a file: copied; there already, alike; there and different, so that it stays; left out."""


@dataclass(frozen=True)
class Merged:
    """What became of one file of a store.

    Attributes:
        path: the file.
        fate: see `Fate`.
        reason: a clause that says what differs or what is damaged; empty otherwise.
    """

    path: Path
    fate: Fate
    reason: str = ""

    def __str__(self) -> str:
        """Return one line for the terminal."""
        return printable(f"{self.path}: {self.reason or self.fate}")


def merge_trials(source: Store, into: Store, dry_run: bool = False) -> Iterator[Merged]:
    """Copy the trials of a store with their champions; what is in the other store stays.

    A trial that timed out or crashed has no outcome: it gives way to one that has, or that had more time.

    Raises:
        UserError: when the disk is full or read-only.
    """
    for path in source.record_paths():
        try:
            result = source.read(path)
            if result is None:
                continue
            packed = source.whole_champion(path, result)
        except DamagedFileError as error:
            yield Merged(error.path, "damaged", f"it is left out: {error.reason}")
            continue
        try:
            present = into.present(result)
            if not (present is None or gives_way(present, result)):
                yield _compared(path, result, into, present)
            elif dry_run or into.put_packed(result, packed) == "stored":
                yield Merged(path, "copied")
            else:  # a running process has stored the trial meanwhile
                yield _compared(path, result, into, into.present(result))
        except DamagedFileError as error:
            yield Merged(error.path, "damaged", f"it stays as it is, and {path} is left out: {error.reason}")


def _compared(path: Path, result: TrialResult, into: Store, present: TrialResult | None) -> Merged:
    """Return whether a record and the one that is there have the same outcome, and else what differs."""
    if present is None or present.digest == result.digest or not {present.status, result.status} <= set(COMPLETE):
        return Merged(path, "there")
    home = into.home(present)
    return Merged(
        path, "differs", f"another record of this trial is in {home} and stays: {_difference(result, present)}"
    )


def _difference(one: TrialResult, other: TrialResult) -> str:
    """Say how two records of one trial differ, the values of the first first."""
    parts = [f"{one.status} and {other.status}"] if one.status != other.status else []
    for name in ("metrics", "levels", "curves"):
        here, there = getattr(one, name), getattr(other, name)
        # As JSON, in which NaN equals NaN.
        keys = [
            key for key in sorted({*here, *there}) if canonical_json(here.get(key)) != canonical_json(there.get(key))
        ]
        scalars = (
            [f"{key} {here.get(key, '–')} and {there.get(key, '–')}" for key in keys] if name == "metrics" else keys
        )
        parts += [f"{name} ({', '.join(scalars)})"] if keys else []
    parts += ["champions"] if one.champion != other.champion else []
    devices = [str(trial.device.get("kind", "an unknown device")) for trial in (one, other)]
    machines = [str(trial.provenance.get("machine", "an unknown machine")) for trial in (one, other)]
    where = devices if devices[0] != devices[1] else machines
    made = f"; made on {where[0]} and {where[1]}" if where[0] != where[1] else "; made on machines of one kind"
    return f"{', '.join(parts) or 'digests'} differ{made}"


def main(options: argparse.Namespace) -> int:
    """Copy what is whole and new, and name what differs or is damaged; 1 when trials differ or files are damaged."""
    into = open_store(options.storage)
    sources = [_source(name, into) for name in options.stores]
    if not options.dry_run:
        into.check_writable()
    wrong = False
    for source in sources:
        fates: Counter[str] = Counter()
        for one in merge_trials(source, into, options.dry_run):
            fates[one.fate] += 1
            if one.reason:
                print(one)
        wrong = wrong or bool(fates["differs"] or fates["damaged"])
        copied = "to copy" if options.dry_run else "copied"
        print(
            f"{source.root}: trials: {fates['copied']} {copied} into {into.root}, {fates['there']} there already, "
            f"{fates['differs']} different; damaged files left out: {fates['damaged']}"
        )
    return int(wrong)


def _source(name: str, into: Store) -> Store:
    """Return a store to copy from.

    Raises:
        UserError: when it does not exist, or is the one to copy into.
    """
    if not name or not os.path.lexists(name):
        raise UserError(f"There is no trial store {name!r}: the folder does not exist. Check its name.")
    source = open_store(name)
    if source.root.resolve() == into.root.resolve():
        raise UserError(
            f"{name} is the store to copy into. Name other stores, or name the store to copy into with --storage."
        )
    return source
