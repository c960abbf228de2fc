"""A batch that the device's memory does not hold, in halves that go on from where it was.

On a processor each trial is a call of its own, so its bits are the same in any batch. Where trials run side by side,
bits can depend on the number of lanes.
"""

from __future__ import annotations

import logging
from dataclasses import replace
from datetime import UTC, datetime

import jax

from evoclaims.core.errors import UserError
from evoclaims.trials import checkpoint
from evoclaims.trials.batches import Run
from evoclaims.trials.checkpoint import Header
from evoclaims.trials.lanes import picked
from evoclaims.trials.program import TrialState
from evoclaims.trials.progress import RunProgress

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
    least = 1 if run.lanes.layout == "alone" else len(run.lanes.devices)
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
