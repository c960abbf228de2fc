"""The loop that runs trials: device calls of about a second, with reports and files in between."""

from __future__ import annotations

import logging
import math
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, Final

import jax
import numpy as np

from evoclaims.core.errors import UserError
from evoclaims.core.packages import absent
from evoclaims.core.waiting import working_time
from evoclaims.trials import checkpoint
from evoclaims.trials.batches import Batch, Run, StoredTrials, batches, drop_finished_checkpoints, halved, is_exhausted
from evoclaims.trials.checkpoint import Header
from evoclaims.trials.devices import give_back, single_threaded_linear_algebra
from evoclaims.trials.imported import into_store
from evoclaims.trials.lanes import Lanes, picked
from evoclaims.trials.lease import announced, shared
from evoclaims.trials.loop_trials import LoopTrials
from evoclaims.trials.program import Report
from evoclaims.trials.progress import RunProgress, Watcher, ignore
from evoclaims.trials.result import TrialResult, check_success
from evoclaims.trials.result_making import curve_point, make_result, make_unfinished
from evoclaims.trials.spec import Condition, TrialSpec
from evoclaims.trials.stopping import Allowance, OutOfTimeError, postponed
from evoclaims.trials.store import DamagedFileError, Store

CALL_SECONDS: Final = 1.0
"""Approximate length of one device call: a checkpoint can only be written after one."""

AFFORDED: Final = 0.03
"""Seconds that a checkpoint may take per second between two checkpoints; slower ones are written less often."""

CHECKPOINT_SECONDS: Final = 1.0
"""Minimum time between two checkpoints: what a kill can cost."""

_log = logging.getLogger(__name__)


def run(
    condition: Condition,
    seeds: Sequence[int],
    store: Store,
    devices: Sequence[jax.Device],
    watch: Watcher = ignore,
    checkpoint_seconds: float = CHECKPOINT_SECONDS,
    time_limit: float = math.inf,
    any_version: bool = False,
) -> list[TrialResult]:
    """Return the trials of `condition` with these seeds; run those that are not in the store.

    A stored trial from other versions than this environment's is run again, and both records stay; with `any_version`
    it is accepted.

    Each trial is stored as soon as it ends. A kill loses at most the time since the last checkpoint, from which the
    same call resumes with the same bits (on the same kind of device and versions).

    A batch that takes longer than `time_limit` (seconds, on the device and compiling, in all calls together) ends
    there: its trials are stored as "timeout" with their curves so far, and run again only when a call allows more. With
    a limit the work is done on another thread, since it may never return (see `stopping.Allowance`).

    A batch that the device's memory does not hold goes on in two halves (see `batches.halved`).

    Of a condition whose trials exist already, there may be fewer than seeds.

    Raises:
        UserError: when the store is damaged or cannot be written, or the device's memory does not hold one trial.
    """
    if condition.existing:
        return into_store(condition, seeds, store)
    stored = StoredTrials(store, condition, any_version, time_limit)
    wanted = list(dict.fromkeys(seeds))
    make: Maker | None = None  # it asks for all that running needs, which reading does not
    while not stored.answer(found := [stored.get(seed) for seed in wanted]):
        if make is None:
            warn_of_edited_bodies(condition, store)
            make = _maker(stored, devices, checkpoint_seconds, len(wanted))
        store.check_writable()
        with (
            announced(store.root, condition.id, lambda text: watch(RunProgress(condition.label, text, len(seeds)))),
            shared(store.root, condition.id, watch) as tell,
        ):
            owed = [seed for seed in wanted if stored.lacks(seed)]  # another process may have stored some meanwhile
            make(owed, tell)
    drop_finished_checkpoints(stored)
    return [result for result in found if result is not None]


Maker = Callable[[Sequence[int], Watcher], None]
"""Makes trials of a condition by their seeds, and stores each as it ends; it is called again if any is left."""


def _maker(stored: StoredTrials, devices: Sequence[jax.Device], checkpoint_seconds: float, most: int) -> Maker:
    """Return what makes a condition's trials: a process for each, or compiled programs, at first of `most` trials."""
    _ = stored.condition.steps  # a budget that no counter holds is refused before training, not after it
    if stored.condition.loop is not None:
        return LoopTrials(stored, stored.condition.loop, devices).make
    for component in (stored.condition.method, stored.condition.task):
        if missing := absent(component):
            raise UserError(
                f"The packages of {component.name!r} name {', '.join(missing)}, not installed here. Check "
                "the spelling. Trials are keyed by the versions of packages, so they cannot be recorded "
                "without the package."
            )

    def make(owed: Sequence[int], tell: Watcher) -> None:
        """Run batches until all trials are stored, or one turns out too large for the device's memory."""
        nonlocal most
        try:
            most = _run_batches(Run(Lanes(stored.condition, devices), stored, tell, checkpoint_seconds, most), owed)
        finally:
            give_back()  # when nothing holds the compiled programs any more

    return make


def _run_batches(run: Run, owed: Sequence[int]) -> int:
    """Run batches, and return how many trials the next ones may have."""
    with single_threaded_linear_algebra():
        too_large = _finish_all(run, owed)
    return run.most if too_large is None else halved(run, too_large)


def _finish_all(run: Run, owed: Sequence[int]) -> Header | None:
    """Run all batches of the missing trials; or return the one that the device's memory does not hold.

    That is for the caller to split, when nothing refers to this batch and its memory any more.
    """
    for header, begin in batches(run, owed):
        try:
            _finish(run, header, begin)
        except jax.errors.JaxRuntimeError as error:
            if not is_exhausted(error):
                raise
            return header
    return None


def _finish(run: Run, header: Header, begin: Callable[[], Batch | None]) -> None:
    """Run a batch until all its trials are stored or its time is over."""
    allowance, strides = Allowance(run.stored.time_limit - header.spent_seconds), Strides()
    try:
        begun = allowance.spend(begin)
        if begun is None:
            return  # another process finished the batch; `run` restarts what is not stored
        allowance.left -= begun.header.spent_seconds - header.spent_seconds  # another process went on with it meanwhile
        batch, header = begun, begun.header
        rhythm = Rhythm(run.checkpoint_seconds)
        with postponed() as stop:
            while batch.owed:
                batch, progress = _go_on(run, batch, allowance, strides)
                header = batch.header
                late = bool(batch.owed) and allowance.left < 2 * strides.seconds  # the next call might not return
                stopped = stop.is_set()
                if batch.owed and (late or stopped or rhythm.due):
                    with rhythm.saving():
                        _save(run, batch, allowance)
                if progress is not None:
                    run.watch(progress)
                if late:
                    raise OutOfTimeError
                if stopped:
                    break
    except OutOfTimeError:
        _give_up(run, header)
    else:
        checkpoint.remove(run.store.checkpoints, header)


def _go_on(run: Run, batch: Batch, allowance: Allowance, strides: Strides) -> tuple[Batch, RunProgress | None]:
    """Let every running trial take about a second's steps; store those that end; at a chunk's end, report progress."""
    chunk_end = min((batch.header.chunks + 1) * run.condition.budget.chunk(run.condition.cost), run.condition.steps)
    until = strides.after(batch.steps, chunk_end)
    ran, level = batch.header.run_seconds, False
    while not level:  # side by side, trials stop where one ends
        batch, report = _advance(run, batch, until, allowance)
        ended = [lane for lane in batch.running if report.ended[lane]]
        others = [lane for lane in batch.running if not report.ended[lane]]
        level = all(report.steps[lane] >= until for lane in others)
        whole = level and (until == chunk_end or not others)
        if not (level or ended):
            raise RuntimeError("Trials that had taken different numbers of steps, or had ended, shared a program.")
        if whole or not run.lanes.layout.alone:  # alone, a trial that has ended waits unchanged for the chunk's end
            batch = _with_points(run, batch, report, batch.running if whole else ended)
            if ended:
                batch = _store_ended(run, batch, report, ended, allowance)
    strides.took(until - batch.steps, batch.header.run_seconds - ran)
    batch = replace(batch, steps=until)
    if not whole:
        return batch, None
    batch = replace(batch, header=replace(batch.header, chunks=batch.header.chunks + 1))
    progress = _progress(run, batch, report, strides)  # the report has the lanes before narrowing
    return _rearranged(run, batch), progress


def _save(run: Run, batch: Batch, allowance: Allowance) -> None:
    header = replace(batch.header, compile_seconds=batch.header.compile_seconds + run.lanes.seconds)
    if math.isfinite(allowance.left):
        header = replace(header, spent_seconds=run.stored.time_limit - allowance.left)
    checkpoint.save(run.store.checkpoints, header, run.lanes.gather(batch.state))


def _advance(run: Run, batch: Batch, until: int, allowance: Allowance) -> tuple[Batch, Report]:
    """Call the device once."""
    began, used, compiled = working_time(), time.process_time(), run.lanes.seconds
    state, report = allowance.spend(lambda: run.lanes.advance(batch.state, until, len(batch.header.lanes)))
    compiling = run.lanes.seconds - compiled
    seconds, processor = working_time() - began - compiling, max(time.process_time() - used - compiling, 0.0)
    header = replace(
        batch.header,
        run_seconds=batch.header.run_seconds + seconds,
        processor_seconds=batch.header.processor_seconds + processor,
    )
    return replace(batch, header=header, state=state), report


def _with_points(run: Run, batch: Batch, report: Report, lanes: Sequence[int]) -> Batch:
    """Add a point to the curves of the trials in these lanes."""
    curves = dict(batch.header.curves)
    for lane in lanes:
        seed = str(batch.header.lanes[lane])
        point = curve_point(run.condition.cost, report, lane)
        check_success(run.condition.label, point["success"])
        curves[seed] = {name: [*curves[seed].get(name, []), value] for name, value in point.items()}
    return replace(batch, header=replace(batch.header, curves=curves))


def _store_ended(run: Run, batch: Batch, report: Report, ended: Sequence[int], allowance: Allowance) -> Batch:
    """Score the trials in the ended lanes, and store those without a record."""
    header, due = batch.header, [lane for lane in ended if lane in batch.owed]
    timing = _timing(run, header)
    if due:
        score = allowance.spend(lambda: run.lanes.examine(batch.state, len(header.lanes)))
    for lane in due:
        seed = header.lanes[lane]
        assert seed is not None
        spec = TrialSpec(run.condition, seed)
        curves = header.curves[str(seed)]
        put = run.store.put(*make_result(spec, report, score, lane, curves, timing, run.lanes.devices))
        if put == "differs":  # another process has stored the trial meanwhile
            text = f"seed {seed} is stored already and came out differently here: the first record stays"
            run.watch(RunProgress(run.condition.label, text, 1, remark=True))
            _log.warning("%s: %s.", run.condition.label, text)
    running = [None if lane in ended else seed for lane, seed in enumerate(header.lanes)]
    idle = run.lanes.with_idle(batch.state, [seed is None for seed in running])
    return replace(batch, header=replace(header, lanes=running), state=idle)


def _give_up(run: Run, header: Header) -> None:
    limit = run.stored.time_limit
    timing = {**_timing(run, header), "limit": limit}
    owed = [seed for seed in header.seeds if not run.stored.has(seed)]
    for seed in owed:
        spec, curves = TrialSpec(run.condition, seed), header.curves[str(seed)]
        run.store.put(make_unfinished(spec, "timeout", curves, timing, run.lanes.devices), {})
    run.watch(RunProgress(run.condition.label, f"out of time after {limit:g} s", len(owed), remark=True))


def _timing(run: Run, header: Header) -> dict[str, Any]:
    timing = {
        "run": header.run_seconds,
        "compile": header.compile_seconds + run.lanes.seconds,
        "batch": len(header.batch),
        "started": header.started,
    }
    return {**timing, "processor": header.processor_seconds} if run.lanes.layout.alone else timing


def _rearranged(run: Run, batch: Batch) -> Batch:
    """Narrow the batch if that makes the rest cheaper."""
    active, full = batch.running, len(batch.header.batch)
    width = run.lanes.width(len(active), full)
    if not batch.owed or width >= len(batch.header.lanes):
        return batch
    order = run.lanes.arrangement(active, width)
    state = run.lanes.place(picked(run.lanes.gather(batch.state), order), width)
    moved = [None if lane is None else batch.header.lanes[lane] for lane in order]
    return replace(batch, header=replace(batch.header, lanes=moved), state=state)


def _progress(run: Run, batch: Batch, report: Report, strides: Strides) -> RunProgress:
    """Return the batch's progress; `report` must be about its current lanes."""
    shown = batch.owed if batch.owed else list(range(len(report.steps)))
    highest = max((int(report.level[lane]) for lane in shown), default=0)
    best = max((float(report.success[lane]) for lane in shown if report.level[lane] == highest), default=0.0)
    return RunProgress(
        condition=run.condition.label,
        phase="training",
        trials=len(batch.header.batch),
        ended=len(batch.header.batch) - len(batch.owed),
        steps=int(np.max(report.steps)),
        total_steps=run.condition.steps,
        best=best,
        level=highest,
        levels=run.condition.task.levels,
        seconds_left=strides.seconds_for(run.condition.steps - batch.steps) if batch.owed else 0.0,
    )


class Strides:
    """How many steps to run at a time: one at first, then as many as the last stride's speed allows.

    Attributes:
        seconds: the device's time for the last stride, of one call or, where trials ended, of several.
    """

    def __init__(self) -> None:
        """Start without a measured speed."""
        self.seconds = 0.0
        self._per_step = math.inf

    def after(self, reached: int, until: int) -> int:
        """Return the step to run to from step `reached`, at most `until`."""
        return min(until, reached + max(int(CALL_SECONDS / self._per_step), 1))

    def seconds_for(self, steps: int) -> float | None:
        """Return how long `steps` steps will take; None before the first call."""
        return None if math.isinf(self._per_step) else steps * self._per_step

    def took(self, steps: int, seconds: float) -> None:
        """Measure the speed from a call of `steps` steps (at least one)."""
        self.seconds = seconds
        self._per_step = max(seconds, 1e-9) / steps


class Rhythm:
    """When the next checkpoint is due: some seconds after the last one, or later if writing is slow."""

    def __init__(self, seconds: float) -> None:
        """Begin now; `seconds` is the time between two cheap checkpoints, 0 for one after every call."""
        self._seconds = seconds
        self._cost = 0.0
        self._last = time.monotonic()

    @property
    def due(self) -> bool:
        """Whether a checkpoint is due."""
        return time.monotonic() - self._last >= self._seconds * max(1.0, self._cost / AFFORDED)

    @contextmanager
    def saving(self) -> Iterator[None]:
        """Time the writing of a checkpoint."""
        began = time.monotonic()
        yield
        self._last = time.monotonic()
        self._cost = self._last - began


def warn_of_edited_bodies(condition: Condition, store: Store) -> None:
    """Warn when the store has trials of the condition whose robot had the same file and another body."""
    now = dict(_bodies(condition.plain))
    if not now:
        return
    errors: list[DamagedFileError] = []
    here = _without_bodies(condition.plain)
    old = [
        result
        for result in store.results(errors)
        if result.condition != condition.id
        and _without_bodies({name: part for name, part in result.spec.items() if name != "seed"}) == here
    ]
    if old:
        names = sorted({name for result in old for name, body in _bodies(result.spec) if now.get(name) != body})
        warnings.warn(
            f"The model of the robot {', '.join(names)} was edited: {len(old)} stored trials of {condition.label} are "
            "of the old body and do not count, so they run again.",
            stacklevel=2,
        )


def _bodies(plain: Any) -> Iterator[tuple[str, str]]:
    """Yield names and body hashes of the custom robots in a condition's plain form."""
    if isinstance(plain, Mapping):
        if {"xml", "body", "name"} <= plain.keys():
            yield plain["name"], plain["body"]
        for part in plain.values():
            yield from _bodies(part)
    elif isinstance(plain, list | tuple):
        for part in plain:
            yield from _bodies(part)


def _without_bodies(plain: Any) -> Any:
    if isinstance(plain, Mapping):
        return {name: _without_bodies(part) for name, part in plain.items() if not (name == "body" and "xml" in plain)}
    return [_without_bodies(part) for part in plain] if isinstance(plain, list | tuple) else plain
