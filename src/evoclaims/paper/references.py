"""Committed reference trials: one JSON record per line, in reference/<tier>/<method>-<task>.jsonl of a reproduction.

Champions of some of them lie in reference/<tier>/champions, named by their digests.
"""

from __future__ import annotations

import errno
import hashlib
import os
import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import takewhile
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from evoclaims.core.errors import UserError
from evoclaims.core.files import read_file, write_atomically
from evoclaims.core.packages import agree, depends_on, differences, recorded
from evoclaims.judging.drift import DriftCase, check_drift
from evoclaims.judging.drift_report import DigestCheck, DriftReport, compare_digests
from evoclaims.trials.arrays import unpack
from evoclaims.trials.failed import is_final
from evoclaims.trials.result import TrialResult
from evoclaims.trials.result_codec import RecordError, dump, parse
from evoclaims.trials.spec import Condition

METRICS = ("mean_success", "last_fitness", "environment_steps")
"""Metrics that the drift check compares besides what claims read: final success, final reward, environment steps."""

OF_TABLE = {"file", "sha256", "by"}
"""What a specification of imported trials says of their table, and not of how it is read."""

_ID = re.compile(rb'^\{.*?"digest":"[0-9a-f]{64}","id":"([0-9a-f]{64})"', re.MULTILINE)
"""A trial's id in a line as `write` writes it: the keys of a record are sorted."""

_MEND = "Restore the file from version control, or delete it and write it anew with `evoclaims reference`."


def path_of(folder: Path, tier: str, method: str, task: str) -> Path:
    """Return the path of the reference trials of a method on a task."""
    return folder / tier / f"{method}-{task}.jsonl"


def load(path: Path) -> tuple[TrialResult, ...]:
    """Read reference trials; empty if there is no such file.

    Raises:
        UserError: when the file cannot be read, or a line is damaged or edited.
    """
    return _parsed(_read(path), path)


def ids(path: Path) -> tuple[str, ...]:
    """Return the ids of the reference trials in a file without parsing them, which takes a fiftieth of the time.

    Raises:
        UserError: when the file cannot be read, or a line is not a trial's.
    """
    data = _read(path)
    found = tuple(match.decode() for match in _ID.findall(data))
    if len(found) != len(data.splitlines()):
        return tuple(trial.id for trial in _parsed(data, path))  # which says what is wrong
    return found


def _read(path: Path) -> bytes:
    """Read a file of reference trials; empty if there is none."""
    try:
        return read_file(path)
    except FileNotFoundError as error:
        if path.is_symlink():
            raise UserError(f"The reference trials {path} are a link to a file that does not exist. {_MEND}") from error
        return b""
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:  # no file has such a name
            return b""
        raise UserError(f"The reference trials {path} cannot be read: {error.strerror or error}. {_MEND}") from error


@lru_cache(maxsize=512)
def _parsed(data: bytes, path: Path) -> tuple[TrialResult, ...]:
    """Return the trials of a file's contents.

    They are kept: a command reads the same file for several tiers, variants and costs, and a line takes a millisecond.
    """
    results = []
    for number, line in enumerate(data.splitlines(), start=1):
        try:
            results.append(parse(line))
        except RecordError as error:
            raise UserError(f"Line {number} of {path} is not a reference trial: {error.reason}. {_MEND}") from error
    return tuple(results)


def committed(folder: Path, tier: str, method: str, task: str) -> tuple[TrialResult, ...]:
    """Read the reference trials of a method on a task; raises as `load` does."""
    return load(path_of(folder, tier, method, task))


def of_condition(folder: Path, tier: str, method: str, task: str, condition: str) -> tuple[TrialResult, ...]:
    """Read the reference trials of a condition (its id), each once; raises as `load` does.

    Variants of the protocol may share a condition, whose trials then lie under the name of one of them. `folder` has
    all reference trials (`Reproduction.references`).
    """
    found = by_variant(folder, tier, method, task, condition).values()
    return tuple({trial.id: trial for trials in found for trial in trials}.values())


def by_variant(folder: Path, tier: str, method: str, task: str, condition: str) -> dict[str, list[TrialResult]]:
    """Read what `of_condition` does, by the name of the variant under which it lies; "" is the protocol's own."""
    variants = folder / "variants"
    places = [("", folder), *((one.name, one) for one in (sorted(variants.iterdir()) if variants.is_dir() else ()))]
    found = {
        name: [trial for trial in committed(place, tier, method, task) if trial.condition == condition]
        for name, place in places
    }
    return {name: trials for name, trials in found.items() if trials}


def write(path: Path, results: Iterable[TrialResult]) -> None:
    """Write reference trials in the order of seeds."""
    ordered = sorted(results, key=lambda result: result.seed)
    write_atomically(path, b"".join(map(dump, ordered)))


def champion_path(folder: Path, tier: str, result: TrialResult) -> Path:
    """Return the path of the committed champion of a reference trial, as a store packs it."""
    return folder / tier / "champions" / f"{result.champion}.npz"


def champion_of(folder: Path, tier: str, result: TrialResult) -> dict[str, NDArray[Any]] | None:
    """Return the committed champion of a reference trial, arrays by name; None where none is committed.

    Raises:
        UserError: when the file cannot be read, or is not the champion that the trial's record names.
    """
    path = champion_path(folder, tier, result)
    if not os.path.lexists(path):
        return None
    try:
        data = read_file(path)
    except OSError as error:
        raise UserError(f"The champion {path} cannot be read: {error.strerror or error}. {_MEND}") from error
    if hashlib.sha256(data).hexdigest() != result.champion:
        raise UserError(f"{path} is not the champion that its trial's record names. {_MEND}")
    try:
        return unpack(data)
    except ValueError as error:
        raise UserError(f"The champion {path} is {error}. {_MEND}") from error


def of_one_environment(
    records: Sequence[TrialResult], condition: Condition, seeds: Sequence[int], needed: int
) -> list[TrialResult]:
    """Return trials of the first seeds, made by one environment: this one if it has enough, else the newest.

    Reference trials of mixed versions would be useless. If a seed has several records, the last one counts.
    """
    environments = [condition.versions]
    for record in sorted(records, key=lambda record: str(record.timing.get("ended", "")), reverse=True):
        versions = recorded(record.provenance, condition.packages)
        if versions not in environments:
            environments.append(versions)
    runs = []
    for versions in environments:
        made = {record.seed: record for record in records if agree(record.provenance, versions)}
        runs.append([made[seed] for seed in takewhile(made.__contains__, seeds)])
    return next((run for run in runs if len(run) >= needed), max(runs, key=len))


def paired(
    label: str,
    new: Sequence[TrialResult],
    reference: Sequence[TrialResult],
    *,
    method: str = "",
    reads: Collection[str] = (),
    pilot: Sequence[TrialResult] = (),
) -> DriftCase:
    """Pair new trials of one condition (at least one) with earlier ones.

    Imported trials are compared in all their metrics, and with those of an earlier table that was read alike.

    Args:
        label: names the condition.
        new: its new trials.
        reference: its earlier trials.
        method: what its conditions share (see `DriftCase`).
        reads: what claims read of each trial (`SourceTrials.reads`), which is compared besides `METRICS`.
        pilot: earlier trials of other seeds, which count with `reference` if made with the same versions.
    """
    condition = new[0].condition
    if "imported" not in new[0].spec:
        mine = [trial for trial in reference if trial.condition == condition]
        moved = _moved(mine[0], new[0]) if mine else ""
        fitting = tuple(trial for trial in pilot if mine and not _moved(mine[0], trial))
        return DriftCase(
            label,
            condition,
            tuple(new),
            tuple(reference),
            measures(new, reads),
            method=method,
            group=moved,
            pilot=fitting,
        )
    alike = [old for old in reference if _read_alike(old, new[0])]
    others = [old for old in reference if not _read_alike(old, new[0])]
    earlier = (*(replace(old, condition=condition) for old in alike), *others)
    changed = any(old.condition != condition for old in alike)
    everything = tuple(sorted({name for trial in new for name in trial.metrics}))
    return DriftCase(
        label + ", another table" * changed, condition, tuple(new), earlier, everything, _edited(new, alike)
    )


def measures(trials: Sequence[TrialResult], reads: Collection[str]) -> tuple[str, ...]:
    """Return the measures (`drift.measured`) of what claims read of trials, and `METRICS`."""
    done = next((trial for trial in trials if trial.status == "done"), None)
    found: list[str] = []
    for of, _, name in (read.partition(".") for read in sorted(set(reads))):
        if of == "metrics":
            found.append(name)
        elif of == "levels" and done is not None:
            found += [f"{name} at level {level}" for level in range(len(done.levels.get(name, ())))]
        elif of == "curves" and name not in ("steps", "environment_steps", "level"):
            found.append(f"mean {name} while training")
    return tuple(dict.fromkeys([*found, *METRICS]))


def _moved(was: TrialResult, now: TrialResult) -> str:
    """Return which versions differ between two trials, of the packages that both depend on; empty if none does."""
    shared = set(depends_on(was.provenance) or ()) & set(depends_on(now.provenance) or ())
    moved = differences(*(recorded(trial.provenance, tuple(sorted(shared))) for trial in (was, now)))
    return ", ".join(f"{name} {old or 'none'} -> {new or 'none'}" for name, (old, new) in moved.items())


def _edited(new: Sequence[TrialResult], earlier: Sequence[TrialResult]) -> str:
    """Say which earlier trials of a table are judged no longer, or have other numbers now; empty if none."""
    now, before = ({str(trial.provenance["seed_in_table"]): trial.digest for trial in side} for side in (new, earlier))
    found = {
        "reference trials that are judged no longer": [seed for seed in before if seed not in now],
        "with other numbers": [seed for seed, was in before.items() if now.get(seed, was) != was],
    }
    return "; ".join(f"{what}: seeds {', '.join(seeds)} in the table" for what, seeds in found.items() if seeds)


def _read_alike(one: TrialResult, other: TrialResult) -> bool:
    """Whether trials were imported alike, perhaps from different tables: the same columns of the same rows."""
    ours, theirs = (dict(trial.spec.get("imported", {})) for trial in (one, other))
    return all(ours.get(name) == theirs.get(name) for name in (ours.keys() | theirs.keys()) - OF_TABLE)


def compare(cases: Sequence[DriftCase]) -> tuple[DriftReport, DigestCheck]:
    """Check all cases for drift, and trials that should be equal to the bit for their digests."""
    checks = [compare_digests(list(filter(is_final, case.new)), case.reference) for case in cases]
    changed = tuple(change for check in checks for change in check.changed)
    return check_drift(cases), DigestCheck(sum(check.compared for check in checks), changed)
