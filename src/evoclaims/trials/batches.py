"""Batches of trials: gone on with from their checkpoints, or started with what is missing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import numpy as np

from evoclaims.core.canonical import content_hash
from evoclaims.core.provenance import what_fixes_bits
from evoclaims.trials import checkpoint
from evoclaims.trials.checkpoint import Header
from evoclaims.trials.lanes import Lanes, Shares
from evoclaims.trials.outcome import provenance
from evoclaims.trials.progress import RunProgress, Watcher
from evoclaims.trials.spec import Condition, TrialSpec
from evoclaims.trials.store import DamagedFileError, Store


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


@dataclass(frozen=True)
class Batch:
    """Trials under way.

    Attributes:
        header: what a checkpoint says of them.
        state: their state on the devices, share by share.
        stored: seeds in the lanes whose records are there already. An interrupted batch has them where trials ended
            after its last checkpoint and trials run side by side: their bits depend on the number of lanes, so these
            trials run along until they end again, and the batch narrows when it would have without the interruption.
    """

    header: Header
    state: Shares
    stored: frozenset[int] = frozenset()

    @property
    def running(self) -> list[int]:
        """The lanes whose trials have not ended."""
        return [lane for lane, seed in enumerate(self.header.lanes) if seed is not None]

    @property
    def owed(self) -> list[int]:
        """The lanes whose trials have no record yet."""
        return [lane for lane in self.running if self.header.lanes[lane] not in self.stored]


def batches(run: Run, missing: Sequence[int]) -> Iterator[Batch]:
    """Give the interrupted batches that owe one of the missing trials, then the trials that none of them has."""
    remaining = list(missing)
    for header in checkpoint.find(run.store.checkpoints, run.condition.id, _platform(run.lanes)):
        held = [seed for seed in header.lanes if seed is not None]
        if not set(held).isdisjoint(remaining):
            remaining = [seed for seed in remaining if seed not in held]
            yield _resumed(run, header)
    if remaining:
        yield _started(run, remaining)


def drop_finished_checkpoints(store: Store, condition: Condition) -> None:
    """Delete a condition's checkpoints, of whatever platform, whose every trial is stored.

    A kill between the last record and the checkpoint's removal leaves one, and so does a batch that was interrupted on
    other hardware. What is damaged stays for `evoclaims verify`.
    """

    def is_stored(seed: int) -> bool:
        try:
            return store.get(TrialSpec(condition, seed).id) is not None
        except DamagedFileError:
            return False

    for header in checkpoint.sound_ones(store.checkpoints, condition.id):
        if all(seed is None or is_stored(seed) for seed in header.lanes):
            checkpoint.remove(store.checkpoints, header)


def _resumed(run: Run, header: Header) -> Batch:
    """Return an interrupted batch as its checkpoint has it, on the devices."""
    lanes, width = run.lanes, len(header.lanes)
    held = [seed for seed in header.lanes if seed is not None]
    stored = frozenset(seed for seed in held if run.store.get(TrialSpec(run.condition, seed).id) is not None)
    run.watch(RunProgress(run.condition.label, "resuming", len(held) - len(stored)))
    state = checkpoint.restore(run.store.checkpoints, header, lanes.shapes(width))
    if lanes.layout == "alone":
        # A trial's bits are its own: a lane whose trial is stored goes idle, and costs nothing.
        header = replace(header, lanes=[None if seed in stored else seed for seed in header.lanes])
        state = replace(state, idle=state.idle | np.array([seed is None for seed in header.lanes]))
        stored = frozenset()
    return Batch(header, lanes.place(state, width), stored)


def _started(run: Run, seeds: Sequence[int]) -> Batch:
    """Return a new batch."""
    lanes = run.lanes
    run.watch(RunProgress(run.condition.label, "compiling", len(seeds)))
    width = lanes.width(len(seeds), len(seeds))
    order = lanes.arrangement(range(len(seeds)), width)
    placed = [None if lane is None else seeds[lane] for lane in order]
    lanes.programs(width)
    state = lanes.start(placed, width)
    header = Header(
        condition=run.condition.id,
        platform=_platform(lanes),
        batch=list(seeds),
        lanes=placed,
        chunks=0,
        curves={str(seed): {} for seed in seeds},
        run_seconds=0.0,
        compile_seconds=0.0,
        started=datetime.now(UTC).isoformat(timespec="seconds"),
    )
    return Batch(header, state)


def _platform(lanes: Lanes) -> str:
    """Hash what fixes a computation's bits; side by side on several devices, also how many these are."""
    devices = len(lanes.devices) if lanes.layout == "vector" else None
    return content_hash([what_fixes_bits(provenance(lanes.devices)), lanes.layout, devices])
