"""The trial store: sealed JSON files named by content hashes, and champions beside them.

A trial has one record for each set of versions that it was run with: `trials/ab/<id>.<hash>.json`, whose hash is of the
versions that its condition depends on. Records that do not say what they depend on, as some committed ones, are
`trials/ab/<id>.json`.

No locks and no server: files are complete or absent, and a file's name follows from its contents. So several processes
may share a store, and copying a store over another merges them.
"""

from __future__ import annotations

import dataclasses
import hashlib
import os
import shlex
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from numpy.typing import NDArray

from evoclaims.core.errors import StorageError
from evoclaims.core.files import read_file, write_atomically, write_once
from evoclaims.core.packages import Versions, agree, depends_on, recorded
from evoclaims.trials.arrays import pack, unpack
from evoclaims.trials.failed import time_allowed
from evoclaims.trials.result import COMPLETE, TrialResult, matches_digest
from evoclaims.trials.result_codec import RecordError, dump, parse
from evoclaims.trials.store_files import DEFAULT_ROOT, ELSEWHERE, StoreFiles, check_store, mark, record_id

Put = Literal["stored", "present", "differs"]
"""Result of storing a trial: written; already there, bit-identical; already there with another digest."""


class DamagedFileError(StorageError):
    """A file of the store is torn, edited or foreign; `path` is the file and `reason` a clause that says why.

    One of a `later` release is whole, and only of no use here.
    """

    def __init__(self, path: Path, reason: str, *, later: bool = False) -> None:
        """Build the message, which names the file and what to do."""
        todo = (
            "use that later version, or another store"
            if later
            else f"run `evoclaims verify{_storage_of(path)}`, which moves the file aside so that the trial is run again"
        )
        super().__init__(f"Cannot use {path}: {reason}; {todo}.")
        self.path = path
        self.reason = reason
        self.later = later


@dataclass(frozen=True)
class Store(StoreFiles):
    """Trials in one folder; making a `Store` touches no file, so a read-only one can be read."""

    @property
    def option(self) -> str:
        """The option with which a suggested command takes this store; empty for the usual one from here."""
        here = Path.cwd()
        usual = [above / DEFAULT_ROOT for above in (here, *here.parents)]
        return "" if Path(os.path.abspath(self.root)) in usual else f" --storage {shlex.quote(str(self.root))}"

    @property
    def pytest_option(self) -> str:
        """The same for pytest, which would take a folder after a space for one of tests."""
        return self.option.replace(" --storage ", " --claims-storage=", 1)

    def champion_file(self, result: TrialResult) -> Path:
        """Return the file of the champion that a record of this store names."""
        spare = self.spare_champion_path(result.id, result.champion)
        return spare if os.path.exists(spare) else self.champion_path(result.id)

    def has_champion(self, result: TrialResult) -> bool:
        """Whether a record of this store names the same champion and its file exists, even if damaged."""
        named = any(record.champion == result.champion != "" for record in self.records(result.id))
        return named and self.champion_file(result).exists()

    def check(self) -> None:
        """Reject an existing folder that is not a store (see `store_files.check_store`).

        Raises:
            UserError: when it is something else, cannot be read, or is of a later release.
        """
        check_store(self.root)

    def check_writable(self) -> None:
        """Mark the store, and write and remove a small file, to find a bad folder before an hour of training.

        Raises:
            UserError: when the folder is not a store, cannot be written, or the disk is full.
        """
        self.check()
        mark(self.root)
        probe = self.root / f".writable.{os.getpid()}.tmp"
        write_atomically(probe, bytes(4096), ELSEWHERE)
        probe.unlink(missing_ok=True)

    def made_with(self, trial_id: str, versions: Versions) -> TrialResult | None:
        """Return the record made with these versions of all packages that its condition depends on, or None.

        This decides whether a trial must be run in an environment.

        Raises:
            DamagedFileError: when a file that may hold it is torn, edited, foreign or unreadable.
        """
        if not self.may_have_records(trial_id):
            return None
        usual = (self.record_path(trial_id, versions), self.record_path(trial_id))
        for path in usual:
            result = self.read(path)
            if result is not None and agree(result.provenance, versions):
                return result
        # A record from when its condition declared other packages has their hash in its name.
        rest = self.results([], (path for path in self.record_files(trial_id) if path not in usual))
        return next((result for result in rest if agree(result.provenance, versions)), None)

    def get(self, trial_id: str, versions: Versions | None = None) -> TrialResult | None:
        """Return the record of a trial, made with any versions, or None without one.

        For judging or viewing stored trials. Of several records, the one made with `versions` comes first, then the
        newest.

        Raises:
            DamagedFileError: when a file that may hold it is torn, edited, foreign or unreadable.
        """
        found = None if versions is None else self.made_with(trial_id, versions)
        return newest(self.records(trial_id)) if found is None else found

    def records(self, trial_id: str) -> tuple[TrialResult, ...]:
        """Return all records of a trial: one for each set of versions that it was run with; raises as `get` does."""
        if not self.may_have_records(trial_id):
            return ()
        return tuple(result for path in self.record_files(trial_id) if (result := self.read(path)) is not None)

    def others(self, trial_id: str, versions: Versions) -> tuple[TrialResult, ...]:
        """Return the records of a trial that were made with other versions; raises as `get` does."""
        return tuple(result for result in self.records(trial_id) if not agree(result.provenance, versions))

    def read(self, path: Path) -> TrialResult | None:
        """Return the trial in the record file `path` of this store, or None when the file is not there.

        Raises:
            DamagedFileError: when it is torn, edited, foreign or unreadable, or has a wrong name or place.
        """
        trial_id = record_id(path)
        if trial_id is None or path.parent != self.record_path(trial_id).parent:
            raise DamagedFileError(path, "its name or place is not that of a trial record")
        try:
            data = read_file(path)
        except FileNotFoundError:
            return None
        except OSError as error:
            raise DamagedFileError(path, f"it cannot be read ({error.strerror or error})") from error
        try:
            result = parse(data)
        except RecordError as error:
            raise DamagedFileError(path, error.reason, later=error.later) from error
        if result.id != trial_id:
            raise DamagedFileError(path, f"it holds another trial, {result.id}")
        if path.name not in (f"{trial_id}.json", self.home(result).name):
            raise DamagedFileError(path, "its name is not that of the versions that it was made with")
        return result

    def home(self, result: TrialResult) -> Path:
        """Return where a record belongs."""
        return self.record_path(result.id, _versions(result))

    def present(self, result: TrialResult) -> TrialResult | None:
        """Return the stored record of the same trial and versions as `result`; raises as `get` does."""
        versions = _versions(result)
        return self.read(self.home(result)) if versions is None else self.made_with(result.id, versions)

    def put(self, result: TrialResult, champion: Mapping[str, Any]) -> Put:
        """Store a trial and its champion's parameters (named arrays of any shape; empty for none).

        The champion is written first, so that every existing record is complete. A stored trial of the same versions is
        not replaced, whatever its digest, with one exception: a crash or timeout is not an outcome, so a new run
        replaces it (see `gives_way`). If processes put the same trial at the same time, the first record stays and
        keeps its own champion: a champion never overwrites another.

        Returns:
            "stored", "present" (already there with an equal digest) or "differs" (there with another digest).

        Raises:
            UserError: when the disk is full or read-only, or the stored record is damaged.
            ValueError: when `result` or `champion` gives no valid record.
        """
        return self.put_packed(result, pack(champion) if champion else b"")

    def put_packed(self, result: TrialResult, packed: bytes) -> Put:
        """Store a trial with its champion's file, as another store holds it; see `put`."""
        sealed = dataclasses.replace(result, champion=hashlib.sha256(packed).hexdigest() if packed else "")
        record = dump(sealed)
        try:
            parse(record)
        except RecordError as error:  # a bug in the program: found here rather than by the next reader
            raise ValueError(str(error)) from error
        present = self.present(result)
        if present is not None and not gives_way(present, result):
            return "present" if present.digest == result.digest else "differs"
        mark(self.root)
        usual = self.champion_path(sealed.id)
        if packed and not write_once(usual, packed, ELSEWHERE) and _sha256(usual) != sealed.champion:
            write_atomically(self.spare_champion_path(sealed.id, sealed.champion), packed, ELSEWHERE)
        path = self.home(result)
        if present is None and write_once(path, record, ELSEWHERE):
            return "stored"
        first = self.present(result)
        if first is not None and (present is None or not gives_way(first, result)):  # another process was faster
            self._remove_champion_beside(first, sealed)
            return self.put_packed(result, packed)
        write_atomically(path, record, ELSEWHERE)
        return "stored"

    def forget_timeouts(self, trial_ids: Iterable[str], versions: Versions) -> None:
        """Remove the "timeout" records of these trials and versions, so that the trials are run again.

        They have no champion. Damaged records stay: whoever runs their trials names the file.

        Raises:
            StorageError: when a record cannot be removed.
        """
        for path in (path for trial_id in trial_ids for path in self.record_files(trial_id)):
            present = next(self.results([], [path]), None)
            if present is not None and present.status == "timeout" and agree(present.provenance, versions):
                try:
                    path.unlink(missing_ok=True)
                except OSError as error:
                    raise StorageError(f"Cannot remove {path}: {error.strerror or error}.") from error

    def _remove_champion_beside(self, first: TrialResult, sealed: TrialResult) -> None:
        """Remove our champion of a trial that another process stored first with a different champion."""
        if sealed.champion in {first.champion, *(record.champion for record in self.records(sealed.id))}:
            return
        for path in self.champion_files(sealed.id):
            if _sha256(path) == sealed.champion:
                path.unlink(missing_ok=True)

    def champion_of(self, result: TrialResult) -> dict[str, NDArray[Any]]:
        """Return a champion's parameters by name for a record read from this store (empty when the trial has none).

        Raises:
            DamagedFileError: when the champion is missing, torn or swapped.
        """
        data = self.packed_champion(result)
        try:
            return unpack(data) if result.champion else {}
        except ValueError as error:
            raise DamagedFileError(self.champion_file(result), f"it is {error}") from error

    def whole_champion(self, path: Path, result: TrialResult) -> bytes:
        """Return the champion's file for the record in `path`, after checking that both are what the digest says.

        Raises:
            DamagedFileError: for the champion, as `champion_of` does; for the record when its digest is another's.
        """
        self.champion_of(result)
        packed = self.packed_champion(result)
        if not matches_digest(result, packed):
            raise DamagedFileError(path, "its digest is not that of its contents, so it was edited")
        return packed

    def packed_champion(self, result: TrialResult) -> bytes:
        """Return the champion's file for a record read from this store, empty without one; raises as `champion_of`."""
        if not result.champion:
            return b""
        path = self.champion_file(result)
        try:
            data = read_file(path)
        except OSError as error:
            raise DamagedFileError(path, f"it cannot be read ({error.strerror or error})") from error
        if hashlib.sha256(data).hexdigest() != result.champion:
            raise DamagedFileError(path, "it is not the champion that the trial's record names")
        return data

    def ids(self) -> tuple[str, ...]:
        """Return the sorted ids of the stored trials, from file names only; the files are not opened."""
        named = ((record_id(path), path) for path in self.record_paths())
        return tuple(sorted({one for one, path in named if one and path.parent == self.record_path(one).parent}))

    def results(self, errors: list[DamagedFileError], paths: Iterable[Path] | None = None) -> Iterator[TrialResult]:
        """Iterate over every valid record in the order of ids, or in some files; append to `errors` for each bad file.

        A trial that was run with several versions has several records.
        """
        for path in self.record_paths() if paths is None else paths:
            try:
                if (result := self.read(path)) is not None:
                    yield result
            except DamagedFileError as error:
                errors.append(error)


def _storage_of(path: Path) -> str:
    """Return the option with which a command uses the store that a file is in; empty for the usual store from here."""
    root = next((above.parent for above in path.parents if above.name in ("trials", "champions", "checkpoints")), None)
    return "" if root is None else Store(root).option


def gives_way(present: TrialResult, result: TrialResult) -> bool:
    """Whether `result` replaces a stored trial without an outcome: it has one, more time, or is the later failure."""
    if present.status in COMPLETE or result.status in COMPLETE:
        return present.status not in COMPLETE
    if present.status == result.status == "timeout":
        return time_allowed(result) > time_allowed(present)
    return present.digest != result.digest and _ended(result) >= _ended(present)


def _versions(result: TrialResult) -> Versions | None:
    """Return the versions that the name of a record stands for; None for old ones, whose names have no versions."""
    packages = depends_on(result.provenance)
    return None if packages is None else recorded(result.provenance, packages)


def newest(results: Iterable[TrialResult]) -> TrialResult | None:
    """Return the newest record; None without any. Records without a time count as oldest."""
    return max(results, key=_ended, default=None)


def _ended(result: TrialResult) -> str:
    return str(result.timing.get("ended", ""))


def _sha256(path: Path) -> str:
    """Return the hash of a file; empty when it cannot be read."""
    try:
        return hashlib.sha256(read_file(path)).hexdigest()
    except OSError:
        return ""
