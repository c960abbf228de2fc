"""Committed pilots: trials with other seeds than a tier's, in pilot/<tier>/<method>-<task>.jsonl of a reproduction.

Bounds may be chosen from the first pilot. By trials that have chosen its bounds a claim looks too sure. So its power is
read from a second pilot of other seeds, in second_pilot/, as soon as there is one. New trials are compared with both.

Only the numbers that claims read are kept. The first line has what all trials share, each other line is a trial.
"""

from __future__ import annotations

import contextlib
from collections import UserDict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, NoReturn

from msgspec import Struct, convert, json

from evoclaims.core.canonical import canonical_json, content_hash
from evoclaims.core.errors import UserError
from evoclaims.core.files import read_file, write_atomically
from evoclaims.core.printable import printable
from evoclaims.judging.design import Design
from evoclaims.judging.reading import TrialReading
from evoclaims.judging.sample import UnreadableTrialError
from evoclaims.trials.result import Status, TrialResult
from evoclaims.trials.spec import Condition

SCHEMA: Final = 1

_MEND: Final = (
    "Restore the file from version control, or remove it and make it anew with `evoclaims power --run` "
    "(`--pilot first` or `second` chooses which)."
)


class _Shared(Struct):
    """What the first line has: `provenances` are those of the trials, each of which has the number of its own."""

    schema: int
    seal: str
    condition: str
    spec: dict[str, Any]
    provenances: list[dict[str, Any]]


class _Trial(Struct):
    """What the line of a trial has."""

    seed: int
    status: Status
    provenance: int
    metrics: dict[str, float]
    levels: dict[str, tuple[float, ...]]
    curves: dict[str, tuple[float, ...]]


def path_of(folder: Path, tier: str, method: str, task: str, *, second: bool) -> Path:
    """Return the path of the first or the second pilot of a method on a task, in the folder of a reproduction."""
    return _of_tier(folder, tier, second=second) / f"{method}-{task}.jsonl"


def has_second(folder: Path, tier: str) -> bool:
    """Whether a tier has a second pilot, from which power is read."""
    return _of_tier(folder, tier, second=True).is_dir()


def _of_tier(folder: Path, tier: str, *, second: bool) -> Path:
    return folder / ("second_pilot" if second else "pilot") / tier


def both(folder: Path, tier: str, method: str, task: str, condition: str) -> tuple[TrialResult, ...]:
    """Return the trials of both pilots that are of a condition, by its id; a seed of both counts once."""
    read = (load(path_of(folder, tier, method, task, second=second)) for second in (False, True))
    found = {trial.seed: trial for trials in read for trial in trials if trial.condition == condition}
    return tuple(found[seed] for seed in sorted(found))


def write(path: Path, trials: Collection[TrialResult], readings: Sequence[TrialReading]) -> None:
    """Write what some readings read of the trials of a condition, in the order of seeds."""
    kept = sorted((_kept(trial, readings) for trial in trials), key=lambda trial: trial.seed)
    provenances = list({canonical_json(trial.provenance): dict(trial.provenance) for trial in kept}.values())
    lines = [{**_own(trial), "provenance": provenances.index(dict(trial.provenance))} for trial in kept]
    spec = {name: value for name, value in kept[0].spec.items() if name != "seed"}
    shared = {"schema": SCHEMA, "condition": kept[0].condition, "spec": spec, "provenances": provenances}
    written = [canonical_json(line) for line in ({**shared, "seal": content_hash([shared, *lines])}, *lines)]
    write_atomically(path, "".join(f"{line}\n" for line in written).encode("ascii"))


def load(path: Path) -> tuple[TrialResult, ...]:
    """Read a pilot as trials that have only the kept numbers; empty if there is no such file.

    Raises:
        UserError: when the file cannot be read, or is damaged or edited.
    """
    try:
        first, *rest = map(json.decode, read_file(path).splitlines() or [b""])
        shared, trials = convert(first, _Shared), convert(rest, list[_Trial], strict=False)  # "nan" is a float
        sealed = {name: value for name, value in first.items() if name != "seal"}
        if shared.schema != SCHEMA:
            _fail(path, f"its schema is {shared.schema} and this version of evoclaims reads schema {SCHEMA}")
        if content_hash([sealed, *rest]) != shared.seal or content_hash(shared.spec) != shared.condition:
            _fail(path, "its contents do not match its seal, so it was torn or edited")
        return tuple(_result(shared, trial) for trial in trials)
    except FileNotFoundError:
        return ()
    except OSError as error:
        _fail(path, error.strerror or str(error))
    except (ValueError, RecursionError, IndexError) as error:
        _fail(path, str(error))


def unfit(trials: Sequence[TrialResult], condition: Condition, design: Design, readings: Iterable[TrialReading]) -> str:
    """Return a clause that says why trials are no pilot of a condition for some readings; empty if they are."""
    if not trials:
        return "it has not been made"
    if trials[0].condition != condition.id:
        return "it is of another condition, since method, task or budget have changed"
    shared = {trial.seed for trial in trials} & set(design.seeds(design.with_third_look().last.n))
    if shared:
        return f"it has seeds of the tier's own trials ({', '.join(map(str, sorted(shared)))})"
    if len(trials) < design.last.n:
        return f"it has {len(trials)} trials and a verdict looks at {design.last.n}"
    crashed = [str(trial.seed) for trial in trials if trial.status == "crashed"]
    if crashed:
        return f"its trials of the seeds {', '.join(crashed)} crashed"
    try:
        for reading in readings:
            for trial in trials:
                reading.of(trial)
    except UnreadableTrialError as error:
        return f"a claim reads what it lacks: {str(error).removesuffix('.')}"
    return ""


def not_second(trials: Iterable[TrialResult], first: Iterable[TrialResult]) -> str:
    """Return a clause that says why trials are no second pilot beside a first one; empty if they are."""
    shared = {trial.seed for trial in trials} & {trial.seed for trial in first}
    return f"it has seeds of the first pilot ({', '.join(map(str, sorted(shared)))})" if shared else ""


class _Noting(UserDict[str, Any]):
    """Numbers by name that keeps those which are asked for."""

    def __init__(self, numbers: Mapping[str, Any]) -> None:
        super().__init__(numbers)
        self.asked: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        self.asked[name] = self.data[name]
        return self.asked[name]


def read_of(trial: TrialResult, readings: Iterable[TrialReading]) -> tuple[str, ...]:
    """Return the names of what some readings read of a trial, such as "metrics.stones" and "levels.success"."""
    kept = _kept(trial, readings)
    return tuple(f"{of}.{name}" for of in ("metrics", "levels", "curves") for name in sorted(getattr(kept, of)))


def _kept(trial: TrialResult, readings: Iterable[TrialReading]) -> TrialResult:
    """Return a trial with only those numbers that are read."""
    metrics, levels, curves = map(_Noting, (trial.metrics, trial.levels, trial.curves))
    for reading in readings:
        with contextlib.suppress(UnreadableTrialError):  # `unfit` says so
            reading.of(replace(trial, metrics=metrics, levels=levels, curves=curves))
    return replace(trial, metrics=metrics.asked, levels=levels.asked, curves=curves.asked)


def _result(shared: _Shared, trial: _Trial) -> TrialResult:
    spec = {**shared.spec, "seed": trial.seed}
    return TrialResult(
        id=content_hash(spec),
        condition=shared.condition,
        spec=spec,
        digest="",
        timing={},
        provenance=shared.provenances[trial.provenance],
        **_own(trial),
    )


def _own(trial: TrialResult | _Trial) -> dict[str, Any]:
    """Return what a trial and its line have alike."""
    return {name: getattr(trial, name) for name in ("seed", "status", "metrics", "levels", "curves")}


def _fail(path: Path, why: str) -> NoReturn:
    raise UserError(f"{path} is not a pilot: {printable(why).removesuffix('.')}. {_MEND}")
