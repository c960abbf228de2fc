"""The one loop that runs trials: chunk by chunk on the device, reports and files in between."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Final

import jax
import numpy as np

from evoclaims.core.errors import UserError
from evoclaims.trials import checkpoint
from evoclaims.trials.batches import Batch, Run, batches, drop_finished_checkpoints
from evoclaims.trials.devices import single_threaded_linear_algebra
from evoclaims.trials.lanes import Lanes
from evoclaims.trials.notice import Notice, wait_while_others_run
from evoclaims.trials.outcome import curve_point, make_result
from evoclaims.trials.program import Report
from evoclaims.trials.progress import RunProgress, Watcher, ignore
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Condition, TrialSpec
from evoclaims.trials.store import Store

_log = logging.getLogger(__name__)

CHECKPOINT_SECONDS: Final = 5.0
"""Least time between two checkpoints: what a kill can cost, against the time that writing takes."""


def run(
    condition: Condition,
    seeds: Sequence[int],
    store: Store,
    devices: Sequence[jax.Device],
    watch: Watcher = ignore,
    checkpoint_seconds: float = CHECKPOINT_SECONDS,
) -> list[TrialResult]:
    """Return the trials of `condition` with these seeds, running those that the store lacks.

    Each trial is stored as soon as it has ended; a kill at any moment loses at most the time since the last
    checkpoint, from which the same call goes on to the same bits (on the same kind of device and versions).

    Raises:
        UserError: when the store is damaged or cannot be written, or the device's memory does not hold the batch.
    """
    specs = {seed: TrialSpec(condition, seed) for seed in seeds}
    while any(store.get(spec.id) is None for spec in specs.values()):
        store.check_writable()
        wait_while_others_run(
            store.root, condition.id, lambda text: watch(RunProgress(condition.label, text, len(seeds)))
        )
        with Notice(store.root, condition.id) as notice:
            if notice.other is not None:
                continue  # another process was faster: wait for it, then look again
            missing = [seed for seed, spec in specs.items() if store.get(spec.id) is None]
            one = Run(Lanes(condition, devices), store, watch, checkpoint_seconds)
            with single_threaded_linear_algebra(), _memory_told(condition, len(missing)):
                for batch in batches(one, missing):
                    _finish(one, batch)
    drop_finished_checkpoints(store, condition)
    results = [store.get(spec.id) for spec in specs.values()]
    return [result for result in results if result is not None]


@contextmanager
def _memory_told(condition: Condition, trials: int) -> Iterator[None]:
    """Say in a sentence that the device has run out of memory."""
    try:
        yield
    except jax.errors.JaxRuntimeError as error:
        if "RESOURCE_EXHAUSTED" not in str(error):
            raise
        raise UserError(
            f"The device's memory does not hold {trials} trials of {condition.label} at once. Run fewer at a time: "
            "`evoclaims run` with --trials and --first-seed stores them part by part, and stored trials are not run "
            "again."
        ) from error


def _finish(run: Run, batch: Batch) -> None:
    """Run a batch until none of its trials is owed, storing each when it ends and a checkpoint now and then."""
    folder, began, first_chunk = run.store.checkpoints, time.monotonic(), batch.header.chunks
    saved = began
    while batch.owed:
        batch, report = _advance(run, batch)
        ended = [lane for lane in batch.running if report.ended[lane]]
        if ended:
            batch = _store_ended(run, batch, report, ended)
        reported = batch  # the lanes that the report speaks of
        if ended:
            batch = _rearranged(run, batch)
        now = time.monotonic()
        if batch.owed and now - saved >= run.checkpoint_seconds:
            spent = batch.header.compile_seconds + run.lanes.seconds
            checkpoint.save(folder, replace(batch.header, compile_seconds=spent), run.lanes.gather(batch.state))
            saved = now
        pace = (now - began) / (batch.header.chunks - first_chunk)
        run.watch(_progress(run, reported, report, pace))
    checkpoint.remove(folder, batch.header)


def _advance(run: Run, batch: Batch) -> tuple[Batch, Report]:
    """Run one chunk and note each running trial's point on its curve."""
    cost = run.condition.method.cost(run.condition.task)
    chunks, began = batch.header.chunks + 1, time.perf_counter()
    until = min(chunks * run.condition.budget.chunk(cost), run.condition.steps)
    state, report = run.lanes.advance(batch.state, until, len(batch.header.lanes))
    curves = dict(batch.header.curves)
    for lane in batch.running:
        seed = str(batch.header.lanes[lane])
        point = curve_point(cost, report, lane)
        curves[seed] = {name: [*curves[seed].get(name, []), value] for name, value in point.items()}
    spent = batch.header.run_seconds + time.perf_counter() - began
    header = replace(batch.header, chunks=chunks, curves=curves, run_seconds=spent)
    return replace(batch, header=header, state=state), report


def _store_ended(run: Run, batch: Batch, report: Report, ended: Sequence[int]) -> Batch:
    """Judge the trials in the lanes that have ended, and store those that are owed."""
    header, due = batch.header, [lane for lane in ended if lane in batch.owed]
    timing = {
        "run": header.run_seconds,
        "compile": header.compile_seconds + run.lanes.seconds,
        "batch": len(header.batch),
        "started": header.started,
    }
    score = run.lanes.score(batch.state, len(header.lanes)) if due else None
    for lane in due:
        seed = header.lanes[lane]
        assert seed is not None
        assert score is not None
        spec = TrialSpec(run.condition, seed)
        curves = header.curves[str(seed)]
        put = run.store.put(*make_result(spec, report, score, lane, curves, timing, run.lanes.devices))
        if put == "differs":
            _tell_of_difference(run, seed)
    running = [None if lane in ended else seed for lane, seed in enumerate(header.lanes)]
    return replace(batch, header=replace(header, lanes=running))


def _tell_of_difference(run: Run, seed: int) -> None:
    """Say that another process has stored the trial meanwhile, with other bits than it has here."""
    text = f"seed {seed} is stored already and came out differently here: the first record stays"
    run.watch(RunProgress(run.condition.label, text, 1))
    _log.warning("%s: %s.", run.condition.label, text)


def _rearranged(run: Run, batch: Batch) -> Batch:
    """Narrow the batch where that makes the rest cheaper."""
    active, full = batch.running, len(batch.header.batch)
    width = run.lanes.width(len(active), full)
    if not batch.owed or width >= len(batch.header.lanes):
        return batch
    order = run.lanes.arrangement(active, width)
    state = run.lanes.rearrange(batch.state, order, width)
    moved = [None if lane is None else batch.header.lanes[lane] for lane in order]
    return replace(batch, header=replace(batch.header, lanes=moved), state=state)


def _progress(run: Run, batch: Batch, report: Report, seconds_per_chunk: float) -> RunProgress:
    """Say where the batch stands; `report` is about its lanes as they are."""
    cost = run.condition.method.cost(run.condition.task)
    shown = batch.owed if batch.owed else list(range(len(report.steps)))
    highest = max((int(report.level[lane]) for lane in shown), default=0)
    best = max((float(report.success[lane]) for lane in shown if report.level[lane] == highest), default=0.0)
    left = -(-run.condition.steps // run.condition.budget.chunk(cost)) - batch.header.chunks
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
        seconds_left=left * seconds_per_chunk if batch.owed else 0.0,
    )
