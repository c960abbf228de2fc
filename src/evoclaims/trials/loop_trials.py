"""Trials of training loops: each in a process of its own, stored as it ends, several at a time on a processor."""

from __future__ import annotations

import contextlib
import math
import os
import queue
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any, Final, Literal

import jax

from evoclaims.core.errors import UserError
from evoclaims.core.portable import to_plain
from evoclaims.core.waiting import waiting, working_time
from evoclaims.methods.training_loop import TrainingLoop
from evoclaims.trials import crashes
from evoclaims.trials.allowance import Allowance, OutOfTimeError
from evoclaims.trials.batches import StoredTrials
from evoclaims.trials.devices import layout_on, usable_cores
from evoclaims.trials.loop_child import Child
from evoclaims.trials.loop_messages import Failed, LoopReport, LoopRequest, Trained, Waiting
from evoclaims.trials.loop_record import trained_record
from evoclaims.trials.progress import RunProgress, Watcher
from evoclaims.trials.result_making import make_unfinished
from evoclaims.trials.spec import TrialSpec

_ONE_THREAD: Final = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Each trial has a core, and sums that are split among threads would have other roundings on other machines."""


@dataclass
class RunningLoop:
    """A trial that is running, as the thread that waits for it has heard.

    Attributes:
        spec: the trial.
        began: when its process began, UTC.
        points: of the training curve.
        newest: the last report; None before the first.
        seconds: that its process lived, without those that some process waited for another one.
        outcome: what it has come to, or "late"; None until all this is known.
    """

    spec: TrialSpec
    began: str = ""
    points: list[LoopReport] = field(default_factory=list)
    newest: LoopReport | None = None
    seconds: float = 0.0
    outcome: Trained | Failed | Literal["late"] | None = None

    @property
    def curves(self) -> dict[str, list[float]]:
        """The training curves; a number that a report left out is NaN there."""
        names = dict.fromkeys(name for point in self.points for name in point.numbers)
        steps = [float(point.step) for point in self.points]
        reported = {name: [point.numbers.get(name, math.nan) for point in self.points] for name in names}
        return {**reported, "steps": steps, "environment_steps": steps} if steps else {}


class LoopTrials:
    """Makes a training loop's trials."""

    def __init__(self, stored: StoredTrials, devices: Sequence[jax.Device]) -> None:
        """Start nothing yet.

        Raises:
            UserError: when a package is missing that the loop declares, its arguments cannot be passed on, or its task
                has no horizon, without which no policy can be examined.
        """
        self._stored = stored
        self._devices = devices
        self._method: TrainingLoop = stored.condition.method  # type: ignore[assignment]
        missing = [name for name in self._method.packages if stored.condition.versions[name] is None]
        if missing:
            raise UserError(
                f"The training loop {self._method.name!r} needs {', '.join(missing)}, which is not "
                f"installed. Install it: pip install {' '.join(missing)}"
            )
        _ = stored.condition.task.horizon  # a task without one is refused before training, not after it
        self._request = {
            "function": self._method.place,
            "task": to_plain(stored.condition.task),
            "budget": to_plain(stored.condition.budget),
            "settings": to_plain(dict(self._method.settings)),
        }
        self._events: queue.SimpleQueue[RunningLoop | BaseException] = queue.SimpleQueue()
        self._lock = threading.Lock()  # of what follows
        self._children = set[Child]()
        self._stopping = False

    def make(self, owed: Sequence[int], tell: Watcher) -> None:
        """Run trials and store each as it ends; those that have ended stay when anything is raised."""
        at_a_time = usable_cores() if layout_on(self._devices[0].platform) == "alone" else 1
        running = [RunningLoop(TrialSpec(self._stored.condition, seed)) for seed in owed]
        began, stored = time.monotonic(), set[int]()
        with ThreadPoolExecutor(at_a_time) as pool:
            try:
                for one in running:
                    pool.submit(self._attend, one)
                while len(stored) < len(running):
                    heard = self._events.get()
                    if isinstance(heard, BaseException):
                        raise heard
                    if heard.outcome and heard.spec.seed not in stored:
                        self._store(heard, tell)
                        stored.add(heard.spec.seed)
                    tell(self._progress(running, len(stored), time.monotonic() - began))
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                with self._lock:
                    self._stopping = True  # also those that are being started
                    for child in self._children:
                        child.stop()
                raise

    def _attend(self, one: RunningLoop) -> None:
        """Run a trial's process to its end, on a thread of its own; what happens becomes an event each."""
        try:
            began, one.began = working_time(), datetime.now(UTC).isoformat(timespec="seconds")
            child = Child(LoopRequest(seed=one.spec.seed, **self._request), self._environment())
            with self._lock:
                self._children.add(child)
                if self._stopping:
                    child.stop()
            outcome: Trained | Failed | Literal["late"] | None = "late"
            try:
                outcome = Allowance(self._stored.time_limit).spend(lambda: self._listen(child, one))
            except OutOfTimeError:
                pass
            finally:
                with self._lock:
                    self._children.discard(child)
                reason = child.close()
            one.seconds = working_time() - began
            one.outcome = outcome or Failed(reason)
            self._events.put(one)
        except BaseException as error:
            self._events.put(error)

    def _listen(self, child: Child, one: RunningLoop) -> Trained | Failed | None:
        """Note what a process reports, and return its last answer; None if it ended without one."""
        with contextlib.ExitStack() as waits:
            for answer in child.answers():
                if isinstance(answer, Waiting):
                    waits.close()
                    if answer.stopped:
                        waits.enter_context(waiting())
                    continue
                if not isinstance(answer, LoopReport):
                    return answer
                one.newest = answer
                one.points += [answer] * answer.kept
                self._events.put(one)
        return None

    def _environment(self) -> Mapping[str, str]:
        """Return what a process's environment has besides this one's: its modules, one thread, and these devices."""
        config: Any = jax.config
        modules = os.pathsep.join(os.path.abspath(path) for path in sys.path)
        chosen = {"PYTHONPATH": modules, "PYTHONHASHSEED": "0", **_ONE_THREAD}
        chosen["JAX_TRACEBACK_FILTERING"] = "remove_frames"  # a crash ends with the error then, not with a note
        if config.jax_compilation_cache_dir:  # what one trial has compiled serves the others
            chosen["JAX_COMPILATION_CACHE_DIR"] = config.jax_compilation_cache_dir
        if self._devices[0].platform == "cpu":
            return {**chosen, "JAX_PLATFORMS": "cpu", "CUDA_VISIBLE_DEVICES": ""}
        return {**chosen, "XLA_PYTHON_CLIENT_PREALLOCATE": "false"}  # this process has taken most of the memory

    def _store(self, one: RunningLoop, tell: Watcher) -> None:
        """Store a trial that has ended."""
        timing = {"run": one.seconds, "compile": 0.0, "batch": 1, "started": one.began}
        failed = ""
        if isinstance(one.outcome, Trained):
            result = trained_record(one.spec, one.outcome, one.curves, timing, self._devices)
        elif isinstance(one.outcome, Failed):
            result = make_unfinished(one.spec, "crashed", one.curves, timing, self._devices, one.outcome.reason)
            crashes.remember(result)
            failed = f"crashed: {crashes.why(result)}"
        else:
            limit = self._stored.time_limit
            result = make_unfinished(one.spec, "timeout", one.curves, {**timing, "limit": limit}, self._devices)
            failed = f"is out of time after {limit:g} s"
        if failed:
            tell(RunProgress(self._stored.condition.label, f"seed {one.spec.seed} {failed}", 0, remark=True))
        self._stored.store.put(result, {})

    def _progress(self, running: Sequence[RunningLoop], ended: int, seconds: float) -> RunProgress:
        """Return how far all trials are."""
        condition = self._stored.condition
        steps = [condition.steps if one.outcome else one.newest.step if one.newest else 0 for one in running]
        reached = [min(step, condition.steps) for step in steps]
        done = sum(reached) / max(condition.steps * len(running), 1)
        reported = [one.newest.numbers["success"] for one in running if one.newest and "success" in one.newest.numbers]
        return RunProgress(
            condition=condition.label,
            phase="training",
            trials=len(running),
            ended=ended,
            steps=max(reached),
            total_steps=condition.steps,
            best=max(reported, default=None),
            seconds_left=seconds * (1 - done) / done if done > 0.01 else None,
        )
