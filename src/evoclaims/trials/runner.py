"""The one loop that runs trials: chunk by chunk on the device, reports and files in between."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Final

import jax
import numpy as np

from evoclaims.core.canonical import content_hash
from evoclaims.core.provenance import collect
from evoclaims.trials import checkpoint
from evoclaims.trials.checkpoint import Header
from evoclaims.trials.devices import single_threaded_linear_algebra
from evoclaims.trials.lanes import Lanes
from evoclaims.trials.notice import Notice, wait_while_others_run
from evoclaims.trials.program import Report, TrialState
from evoclaims.trials.progress import RunProgress, Watcher, ignore
from evoclaims.trials.record import curve_point, make_result
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Condition, TrialSpec
from evoclaims.trials.store import Store

CHECKPOINT_SECONDS: Final = 5.0
"""Least time between two checkpoints: what a kill can cost, against the time that writing takes."""


@dataclass(frozen=True)
class Batch:
    """Trials under way: what a checkpoint says of them, and their state on the devices (leaves [lanes, …])."""

    header: Header
    state: TrialState

    @property
    def owed(self) -> list[int]:
        """The lanes whose trials have no record yet."""
        return [lane for lane, seed in enumerate(self.header.lanes) if seed is not None]


@dataclass(frozen=True)
class Run:
    """Where a condition's trials run, where they are kept, and who watches."""

    lanes: Lanes
    store: Store
    watch: Watcher
    checkpoint_seconds: float

    @property
    def condition(self) -> Condition:
        """The condition being run."""
        return self.lanes.condition


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
        UserError: when the store is damaged or cannot be written.
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
            with single_threaded_linear_algebra():
                for batch in _batches(one, missing):
                    _finish(one, batch, notice)
    results = [store.get(spec.id) for spec in specs.values()]
    return [result for result in results if result is not None]


def _batches(run: Run, missing: Sequence[int]) -> Iterator[Batch]:
    """Give the interrupted batches that owe trials, then the missing trials that none of them has as a new one."""
    lanes, folder, remaining = run.lanes, run.store.checkpoints, list(missing)
    for header in checkpoint.find(folder, run.condition.id, _platform(lanes)):
        stored = [s is None or run.store.get(TrialSpec(run.condition, s).id) is not None for s in header.lanes]
        header = replace(header, lanes=[None if d else s for s, d in zip(header.lanes, stored, strict=True)])
        if all(stored):
            checkpoint.remove(folder, header)
            continue
        run.watch(RunProgress(run.condition.label, "resuming", len(stored) - sum(stored)))
        programs = lanes.programs(len(stored))
        state = checkpoint.restore(folder, header, programs.shapes)
        # A lane whose trial is stored goes idle; the others keep their places, and so their bits.
        state = replace(state, idle=state.idle | np.array(stored))
        remaining = [seed for seed in remaining if seed not in header.lanes]
        yield Batch(header, lanes.place(state, len(stored)))
    if remaining:
        run.watch(RunProgress(run.condition.label, "compiling", len(remaining)))
        width = lanes.width(len(remaining), len(remaining))
        order = lanes.arrangement(range(len(remaining)), width)
        owed = [None if lane is None else remaining[lane] for lane in order]
        lanes.programs(width)
        state = lanes.start(owed, width)
        header = Header(
            condition=run.condition.id,
            platform=_platform(lanes),
            batch=remaining,
            lanes=owed,
            chunks=0,
            curves={str(seed): {} for seed in remaining},
            run_seconds=0.0,
            compile_seconds=0.0,
            started=datetime.now(UTC).isoformat(timespec="seconds"),
        )
        yield Batch(header, state)


def _finish(run: Run, batch: Batch, notice: Notice) -> None:
    """Run a batch to its end, storing each trial when it ends and a checkpoint now and then."""
    folder, began, first_chunk = run.store.checkpoints, time.monotonic(), batch.header.chunks
    saved = began
    while batch.owed:
        batch, report = _advance(run, batch)
        ended = [lane for lane in batch.owed if report.ended[lane]]
        if ended:
            batch = _store_ended(run, batch, report, ended)
            batch = _rearranged(run, batch)
        now = time.monotonic()
        if batch.owed and now - saved >= run.checkpoint_seconds:
            spent = batch.header.compile_seconds + run.lanes.seconds
            checkpoint.save(folder, replace(batch.header, compile_seconds=spent), jax.device_get(batch.state))
            notice.refresh()
            saved = now
        pace = (now - began) / (batch.header.chunks - first_chunk)
        run.watch(_progress(run, batch, report, pace))
    checkpoint.remove(folder, batch.header)


def _advance(run: Run, batch: Batch) -> tuple[Batch, Report]:
    """Run one chunk and note each owed trial's point on its curve."""
    cost = run.condition.method.cost(run.condition.task)
    chunks, began = batch.header.chunks + 1, time.perf_counter()
    until = min(chunks * run.condition.budget.chunk(cost), run.condition.steps)
    state, report = run.lanes.advance(batch.state, until, len(batch.header.lanes))
    curves = dict(batch.header.curves)
    for lane in batch.owed:
        seed = str(batch.header.lanes[lane])
        point = curve_point(cost, report, lane)
        curves[seed] = {name: [*curves[seed].get(name, []), value] for name, value in point.items()}
    spent = batch.header.run_seconds + time.perf_counter() - began
    return Batch(replace(batch.header, chunks=chunks, curves=curves, run_seconds=spent), state), report


def _store_ended(run: Run, batch: Batch, report: Report, ended: Sequence[int]) -> Batch:
    """Judge and store the trials in the lanes that have ended."""
    header = batch.header
    score = run.lanes.score(batch.state, len(header.lanes))
    timing = {
        "run": header.run_seconds,
        "compile": header.compile_seconds + run.lanes.seconds,
        "batch": len(header.batch),
        "started": header.started,
    }
    for lane in ended:
        seed = header.lanes[lane]
        assert seed is not None
        spec = TrialSpec(run.condition, seed)
        curves = header.curves[str(seed)]
        run.store.put(*make_result(spec, report, score, lane, curves, timing, run.lanes.devices))
    owed = [None if lane in ended else seed for lane, seed in enumerate(header.lanes)]
    return Batch(replace(header, lanes=owed), batch.state)


def _rearranged(run: Run, batch: Batch) -> Batch:
    """Narrow the batch, or deal its lanes out anew, where that makes the rest cheaper."""
    width = run.lanes.width(len(batch.owed), len(batch.header.batch))
    order = run.lanes.arrangement(batch.owed, width)
    if not batch.owed or not run.lanes.worth_moving(batch.owed, len(batch.header.lanes), width):
        return batch
    state = run.lanes.rearrange(batch.state, order, width)
    owed = [None if lane is None else batch.header.lanes[lane] for lane in order]
    return Batch(replace(batch.header, lanes=owed), state)


def _progress(run: Run, batch: Batch, report: Report, seconds_per_chunk: float) -> RunProgress:
    """Say where the batch stands."""
    cost = run.condition.method.cost(run.condition.task)
    shown = batch.owed if batch.owed else list(range(len(report.steps)))
    shown = [lane for lane in shown if lane < len(report.steps)]
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


def _platform(lanes: Lanes) -> str:
    """Hash what fixes a computation's bits: kind of device, layout, versions and flags."""
    known = collect()
    kind = lanes.devices[0].device_kind
    return content_hash([kind, lanes.layout, known["machine"], known["versions"], known["xla_flags"]])
