"""Committed reference trials: one JSON record per line, in reference/<tier>/<method>-<task>.jsonl of a reproduction."""

from __future__ import annotations

import errno
from collections.abc import Iterable, Sequence
from pathlib import Path

from evoclaims.core.errors import UserError
from evoclaims.core.files import read_file, write_atomically
from evoclaims.core.provenance import what_fixes_bits
from evoclaims.judging.baseline import DriftCase, DriftReport, check_drift
from evoclaims.judging.tripwire import DigestCheck, compare_digests
from evoclaims.trials.result import TrialResult
from evoclaims.trials.result_codec import RecordError, dump, parse
from evoclaims.trials.time_limit import is_final

METRICS = ("mean_success", "last_fitness", "environment_steps")
"""Metrics that the drift check compares: final success, final reward, and environment steps."""

_MEND = "Restore the file from version control, or write it anew with `evoclaims reference`."


def path_of(folder: Path, tier: str, method: str, task: str) -> Path:
    """Return the path of the reference trials of a method on a task."""
    return folder / tier / f"{method}-{task}.jsonl"


def load(path: Path) -> tuple[TrialResult, ...]:
    """Read reference trials; empty if there is no such file.

    Raises:
        UserError: when the file cannot be read, or a line is damaged or edited.
    """
    try:
        lines = read_file(path).splitlines()
    except FileNotFoundError as error:
        if path.is_symlink():
            raise UserError(f"The reference trials {path} are a link to a file that is not there. {_MEND}") from error
        return ()
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:  # no file has such a name
            return ()
        raise UserError(f"The reference trials {path} cannot be read: {error.strerror or error}. {_MEND}") from error
    results = []
    for number, line in enumerate(lines, start=1):
        try:
            results.append(parse(line))
        except RecordError as error:
            raise UserError(f"Line {number} of {path} is no reference trial: {error.reason}. {_MEND}") from error
    return tuple(results)


def write(path: Path, results: Iterable[TrialResult]) -> None:
    """Write reference trials in the order of seeds."""
    ordered = sorted(results, key=lambda result: result.seed)
    write_atomically(path, b"".join(dump(result).rstrip(b"\n") + b"\n" for result in ordered))


def drift_case(folder: Path, tier: str, method: str, task: str, new: Sequence[TrialResult]) -> DriftCase:
    """Pair new trials of one condition (at least one) with its reference trials."""
    reference = load(path_of(folder, tier, method, task))
    return DriftCase(f"{method} on {task} ({tier})", new[0].condition, tuple(new), reference, METRICS)


def compare(cases: Sequence[DriftCase]) -> tuple[DriftReport, DigestCheck]:
    """Check all cases for drift, and CPU trials for bit-identical results, which only a CPU guarantees."""
    checks = [
        compare_digests([trial], [old for old in case.reference if _bits_should_agree(trial, old)])
        for case in cases
        for trial in case.new
        if _made_on_cpu(trial) and is_final(trial)
    ]
    changed = tuple(change for check in checks for change in check.changed)
    return check_drift(cases), DigestCheck(sum(check.compared for check in checks), changed)


def _bits_should_agree(one: TrialResult, other: TrialResult) -> bool:
    """Whether all settings that fix bits, and that both records contain, are equal; old records contain fewer."""
    ours, theirs = what_fixes_bits(one.provenance), what_fixes_bits(other.provenance)
    return all(ours[name] == theirs[name] for name in ours.keys() & theirs.keys())


def _made_on_cpu(trial: TrialResult) -> bool:
    """Whether a record says that it was made on a CPU; False if it names no device."""
    return trial.device.get("platform") == "cpu"
