"""Batches of trials: resumed from their checkpoints, or started with the missing trials.

A batch that the memory of a device does not hold goes on in halves. On a processor each trial is a call of its own, so
its bits are the same in any batch. Where trials run side by side, bits can depend on the number of lanes.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial

import jax
import numpy as np

from evoclaims.core.canonical import content_hash
from evoclaims.core.errors import UserError
from evoclaims.core.packages import short_hash
from evoclaims.core.provenance import what_fixes_bits
from evoclaims.trials import checkpoint
from evoclaims.trials.checkpoint import Header
from evoclaims.trials.failed import answers, is_final
from evoclaims.trials.lanes import Lanes, Shares, picked
from evoclaims.trials.program import TrialState
from evoclaims.trials.progress import RunProgress, Watcher
from evoclaims.trials.result import TrialResult
from evoclaims.trials.result_making import provenance
from evoclaims.trials.spec import Condition, TrialSpec
from evoclaims.trials.store import DamagedFileError, Store, newest


@dataclass(frozen=True)
class StoredTrials:
    """The stored trials of a condition, which need not be run.

    Attributes:
        store: where they are stored.
        condition: their condition.
        any_version: accept trials made with any versions; else only with this environment's versions.
        time_limit: seconds that a batch may take; a trial that timed out under a smaller limit must be run again.
    """

    store: Store
    condition: Condition
    any_version: bool = False
    time_limit: float = math.inf

    def get(self, seed: int) -> TrialResult | None:
        """Return the stored trial of a seed, or None; raise a `DamagedFileError` if it cannot be read."""
        trial = TrialSpec(self.condition, seed).id
        here = self.store.made_with(trial, self.condition.versions)
        if not self.any_version or is_final(here):
            return here
        there = self.store.records(trial)  # one that came to its end comes before one that did not, here or elsewhere
        return newest(filter(is_final, there)) or here or newest(there)

    def has(self, seed: int) -> bool:
        """Whether the trial of a seed has come to its end."""
        return is_final(self.get(seed))

    def lacks(self, seed: int) -> bool:
        """Whether the trial of a seed must be run; raises as `get` does."""
        return not answers(self.get(seed), self.time_limit)

    def missing(self, seeds: Sequence[int]) -> list[int]:
        """Return the seeds whose trials must be run, damaged ones among them: whoever runs those names the file."""
        if self.condition.existing:
            return []
        there = {result.seed for result in self.sound(seeds) if answers(result, self.time_limit)}
        return [seed for seed in seeds if seed not in there]

    def sound(self, seeds: Iterable[int]) -> Iterator[TrialResult]:
        """Yield the stored trials of these seeds that can be read."""
        for seed in seeds:
            with suppress(DamagedFileError):
                if (result := self.get(seed)) is not None:
                    yield result

    def forget_timeouts(self, seeds: Sequence[int]) -> None:
        """Let those of these trials that ran out of time be run again, with as much time as a new batch.

        Raises:
            StorageError: when a record cannot be removed.
        """
        late = {result.seed for result in self.sound(seeds) if result.status == "timeout"}
        checkpoint.renew(self.store.checkpoints, self.condition.id, late)  # first: it could not be repeated
        self.store.forget_timeouts((TrialSpec(self.condition, seed).id for seed in late), self.condition.versions)

    def answer(self, results: Iterable[TrialResult | None]) -> bool:
        """Whether none of these trials must be run."""
        return all(answers(result, self.time_limit) for result in results)


@dataclass(frozen=True)
class Run:
    """Where a condition's trials run, where they are stored, and who watches.

    Attributes:
        checkpoint_seconds: minimum time between two checkpoints.
        most: trials that a new batch has at most.
    """

    lanes: Lanes
    stored: StoredTrials
    watch: Watcher
    checkpoint_seconds: float
    most: int

    @property
    def condition(self) -> Condition:
        """The condition being run."""
        return self.lanes.condition

    @property
    def store(self) -> Store:
        """Where its trials are stored."""
        return self.stored.store


@dataclass(frozen=True)
class Batch:
    """Running trials.

    Attributes:
        header: what a checkpoint says about them.
        state: their state on the devices, one entry per share.
        stored: seeds in the lanes that already have records. This happens in a resumed batch where trials run side by
            side and some ended after its last checkpoint. Bits depend on the number of lanes, so these trials run
            until they end again, and the batch narrows at the same steps as without the interruption.
        steps: steps the running trials have taken, which may be more than whole chunks.
    """

    header: Header
    state: Shares
    steps: int = 0
    stored: frozenset[int] = frozenset()

    @property
    def running(self) -> list[int]:
        """The lanes whose trials have not ended."""
        return [lane for lane, seed in enumerate(self.header.lanes) if seed is not None]

    @property
    def owed(self) -> list[int]:
        """The lanes whose trials have no record yet."""
        return [lane for lane in self.running if self.header.lanes[lane] not in self.stored]


def batches(run: Run, missing: Sequence[int]) -> Iterator[tuple[Header, Callable[[], Batch | None]]]:
    """Yield the interrupted batches that contain a missing trial, then the other missing trials, `most` in a batch.

    Each comes as its header and a function that begins it, which may take long: it traces and compiles. It returns
    None if the checkpoint of an interrupted batch is gone by then, because another process has finished it.
    """
    remaining = list(missing)
    for header in checkpoint.find(run.store.checkpoints, run.condition.id, _platform(run.lanes)):
        if not set(header.seeds).isdisjoint(remaining):
            remaining = [seed for seed in remaining if seed not in header.seeds]
            yield header, partial(_resumed, run, header)
    # Earlier batches may take hours: another process may have stored the rest meanwhile.
    remaining = [seed for seed in remaining if not run.stored.has(seed)]
    for first in range(0, len(remaining), run.most):
        header = _planned(run.lanes, remaining[first : first + run.most])
        yield header, partial(_started, run, header)


def drop_finished_checkpoints(stored: StoredTrials) -> None:
    """Delete a condition's checkpoints, of any device, whose trials are all stored.

    They come from a kill between the last record and the checkpoint's removal, or from a batch that was interrupted on
    other hardware. Damaged checkpoints stay for `evoclaims verify`, and those of other versions stay for them.
    """

    def is_stored(seed: int) -> bool:
        try:
            return of_these_versions.has(seed)
        except DamagedFileError:
            return False

    of_these_versions = replace(stored, any_version=False)
    folder, here = stored.store.checkpoints, short_hash(stored.condition.versions)
    for header in checkpoint.sound_ones(folder, stored.condition.id):
        if header.versions == here and all(map(is_stored, header.seeds)):
            checkpoint.remove(folder, header)


def _resumed(run: Run, interrupted: Header) -> Batch | None:
    """Load an interrupted batch from its checkpoint onto the devices; None when another process has finished it.

    A process that seemed dead may have continued the batch since its header was read, perhaps hours ago. So header
    and state are read again, together: from two different moments they would mix into a wrong trial.
    """
    folder, lanes = run.store.checkpoints, run.lanes
    owed = sum(not run.stored.has(seed) for seed in interrupted.seeds)
    run.watch(RunProgress(run.condition.label, "resuming", owed))
    while (header := checkpoint.newest(folder, interrupted)) is not None:
        state = checkpoint.restore(folder, header, lanes.shapes(len(header.lanes)))
        if state is not None:
            break
    else:
        return None
    stored = frozenset(filter(run.stored.has, header.seeds))
    if lanes.layout.alone:
        # Bits do not depend on other lanes: a lane whose trial is stored becomes idle, and costs nothing.
        header = replace(header, lanes=[None if seed in stored else seed for seed in header.lanes])
        stored = frozenset()
    # Before 24342677 lanes of stored trials were not marked in the state.
    state = replace(state, idle=state.idle | np.array([seed is None for seed in header.lanes]))
    return Batch(header, lanes.place(state, len(header.lanes)), int(np.max(state.steps)), stored)


def _planned(lanes: Lanes, seeds: Sequence[int]) -> Header:
    width = lanes.width(len(seeds), len(seeds))
    order = lanes.arrangement(range(len(seeds)), width)
    return Header(
        condition=lanes.condition.id,
        platform=_platform(lanes),
        batch=list(seeds),
        lanes=[None if lane is None else seeds[lane] for lane in order],
        chunks=0,
        curves={str(seed): {} for seed in seeds},
        run_seconds=0.0,
        compile_seconds=0.0,
        started=datetime.now(UTC).isoformat(timespec="seconds"),
        versions=short_hash(lanes.condition.versions),
    )


def _started(run: Run, header: Header) -> Batch:
    lanes, width = run.lanes, len(header.lanes)
    run.watch(RunProgress(run.condition.label, "compiling", len(header.batch)))
    lanes.programs(width)
    return Batch(header, lanes.start(header.lanes, width))


def _platform(lanes: Lanes) -> str:
    """Hash what determines a computation's bits; where trials share calls, also the number of devices.

    So does the code of the project's own methods and tasks: a trial is not begun by one and ended by another.
    """
    devices = None if lanes.layout.alone else len(lanes.devices)
    fixed = [what_fixes_bits(provenance(lanes.devices, lanes.condition)), lanes.layout.value, devices]
    code = dict(lanes.condition.code)
    return content_hash([*fixed, code] if code else fixed)


_log = logging.getLogger(__name__)


def is_exhausted(error: BaseException) -> bool:
    """Whether an error says that the device's memory is too small."""
    return isinstance(error, jax.errors.JaxRuntimeError) and "RESOURCE_EXHAUSTED" in str(error)


def halved(run: Run, tried: Header) -> int:
    """Split what a batch has left into two halves, each with a checkpoint if the batch (`tried`) has one.

    Returns:
        The most trials that a batch should have from now on.

    Raises:
        UserError: when no smaller batch takes less of a device's memory.
    """
    header = checkpoint.newest(run.store.checkpoints, tried)
    lanes = (header or tried).lanes
    left = [lane for lane, seed in enumerate(lanes) if seed is not None and not run.stored.has(seed)]
    least = 1 if run.lanes.layout.alone else len(run.lanes.devices)
    if len(left) <= least:
        each = "" if least == 1 else ", one on each device"
        raise UserError(
            f"The device's memory does not hold {len(left)} {'trial' if len(left) == 1 else 'trials'} of "
            f"{run.condition.label} at once{each}, and fewer cannot be run. Close other programs that use "
            "the device, or use one with more memory."
        )
    half = -(-len(left) // 2)
    text = f"the device's memory does not hold {len(left)} trials at once: on with {half}"
    run.watch(RunProgress(run.condition.label, text, 0))
    _log.warning("%s: %s.", run.condition.label, text)
    if header is not None:
        state = checkpoint.restore(run.store.checkpoints, header, run.lanes.shapes(len(header.lanes)))
        if state is not None:  # else another process goes on with it
            _save(run, header, state, left[:half])
            now = datetime.now(UTC).isoformat()  # the second half begins anew: what both have had counts once
            anew = replace(header, started=now, run_seconds=0.0, compile_seconds=0.0, processor_seconds=0.0)
            anew = replace(anew, spent_seconds=0.0)
            _save(run, anew, state, left[half:])
            checkpoint.remove(run.store.checkpoints, header)
    return half


def _save(run: Run, header: Header, state: TrialState, part: list[int]) -> None:
    """Write a checkpoint of some lanes of a batch, as a batch of their own."""
    width = run.lanes.width(len(part), len(part))
    order = run.lanes.arrangement(part, width)
    lanes = [None if lane is None else header.lanes[lane] for lane in order]
    seeds = [seed for lane in part if (seed := header.lanes[lane]) is not None]
    curves = {str(seed): header.curves[str(seed)] for seed in seeds}
    batch = replace(header, batch=seeds, lanes=lanes, curves=curves)
    checkpoint.save(run.store.checkpoints, batch, picked(state, order))
