"""Trials of training loops: each in a process of its own, stored as it ends, several at a time on a processor."""

from __future__ import annotations

import contextlib
import math
import os
import queue
import secrets
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any, Final, Literal

import jax
import msgspec

from evoclaims.core.canonical import content_hash
from evoclaims.core.errors import UserError
from evoclaims.core.portable import to_plain
from evoclaims.core.waiting import waiting, working_time
from evoclaims.methods.training_loop import TrainingLoop
from evoclaims.trials import failed
from evoclaims.trials.batches import StoredTrials
from evoclaims.trials.layout import layout_on
from evoclaims.trials.loop_messages import (
    MARK,
    Answer,
    Failed,
    LoopReport,
    LoopRequest,
    Trained,
    Waiting,
    decode,
    encode,
    end_marked,
    last_lines,
)
from evoclaims.trials.progress import RunProgress, Watcher
from evoclaims.trials.result import RETURNED, TRAINED_BY, Status, TrialResult
from evoclaims.trials.result_making import make_record, make_unfinished
from evoclaims.trials.spec import TrialSpec
from evoclaims.trials.stopping import Allowance, OutOfTimeError, next_of

_READ: Final = 4000
_KEPT: Final = 2**16
"""Bytes at the end of what a process prints that are kept."""
_PATIENCE: Final = 5.0
"""Seconds to wait for the end of that, which something that it has started may hold open."""


class Child:
    """A process that runs one trial."""

    def __init__(self, request: LoopRequest, environment: Mapping[str, str]) -> None:
        """Start it, as the leader of a group of its own, with these environment variables besides this process's."""
        self._mark = secrets.token_hex(16)
        self._process = subprocess.Popen(
            # Modules are where this process has them, and what was printed is there when the process is killed.
            [sys.executable, "-P", "-u", "-m", "evoclaims.trials.loop_process"],
            stdin=subprocess.PIPE,  # stays open as long as this process lives
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env={**os.environ, **environment, MARK: self._mark},
            start_new_session=True,
        )
        self._printed = bytearray()
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):  # one that has died at once is found when it does not answer
            self._process.stdin.write(encode(request))
            self._process.stdin.flush()

    def answers(self) -> Iterator[Answer]:
        """Iterate over its answers, up to the last one; what it has started may keep the pipe open after that."""
        assert self._process.stdout is not None
        for line in self._process.stdout:
            try:
                answer = decode(line)
            except (msgspec.MsgspecError, ValueError):  # it died in the middle of a line
                return
            yield answer
            if not isinstance(answer, LoopReport | Waiting):
                return

    def stop(self) -> None:
        """End it, whatever it does, and what it has started; its number is not given away before it is closed."""
        with contextlib.suppress(OSError):
            os.killpg(self._process.pid, signal.SIGKILL)
        end_marked(self._mark)

    def _listen(self) -> None:
        """Keep the end of what it prints: a progress bar of a day would fill the disk."""
        assert self._process.stderr is not None
        with contextlib.suppress(OSError, ValueError):  # closed meanwhile
            while part := os.read(self._process.stderr.fileno(), _KEPT):
                self._printed += part
                del self._printed[:-_KEPT]

    def close(self) -> str:
        """End it, and return why it ended without an answer: its last lines, and its signal or status."""
        self.stop()
        status = self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            with contextlib.suppress(OSError):
                pipe.close()
        self._listener.join(_PATIENCE)
        last = last_lines(bytes(self._printed[-_READ:]).decode(errors="replace"))
        if not self._listener.is_alive() and self._process.stderr is not None:
            self._process.stderr.close()
        how = signal.Signals(-status).name if -status in set(signal.Signals) else f"status {status}"
        return f"{last}\nits process ended with {how}".lstrip()


SCORED_BY: Final = "scored_by"
"""Key of a provenance that says who has scored the final policy: "examination", or the "training function" itself."""


def trained_record(
    spec: TrialSpec,
    loop: TrainingLoop,
    trained: Trained,
    curves: Mapping[str, Sequence[float]],
    timing: Mapping[str, Any],
    devices: Sequence[jax.Device],
) -> TrialResult:
    """Return the record of a trial whose function has returned.

    The metrics are those of the function, those of every method (see `result_making.make_result`) and the task's own.
    The examination's numbers count, not the function's. Without one, those that the function does not return
    are NaN: a claim that reads such a number is an error. See `why_diverged` for the status.
    """
    returned, scores = trained.metrics, trained.scores
    if scores is None:  # the last level at most is known
        unknown = (math.nan,) * (spec.condition.task.levels - 1)
        levels = {name: (*unknown, returned.get(f"last_{name}", math.nan)) for name in ("success", "fitness")}
    else:
        levels = {"success": scores.success, "fitness": scores.fitness}
    reported = spec.condition.steps if trained.step is None else trained.step
    steps, in_generations = returned.get("environment_steps", reported), spec.condition.budget.generations is not None
    success = levels["success"]
    solved = [level for level, value in enumerate(success) if value == 1.0 or math.isnan(value)]
    furthest = max(solved, default=-1)  # unknown where a level above the solved ones is
    metrics = {
        "mean_success": math.fsum(success) / len(success),
        "last_success": success[-1],
        "last_fitness": levels["fitness"][-1],
        "furthest_solved": math.nan if solved and math.isnan(success[furthest]) else float(furthest),
        "furthest_reached": math.nan,
        "steps": float(returned.get("steps", reported if in_generations else steps)),
        "environment_steps": float(steps),
    }
    if scores is None:
        metrics |= returned
    else:
        known = {name: value for name, value in metrics.items() if not math.isnan(value)}
        metrics |= returned | known | scores.metrics
    status: Status = "diverged" if why_diverged(trained) else "done"
    origin = {
        TRAINED_BY: loop.place,
        SCORED_BY: "training function" if scores is None else "examination",
        RETURNED: {
            "metrics": content_hash(dict(returned)),
            "actions": trained.actions,
            "graded": trained.graded,
            "counts_steps": "environment_steps" in returned or not in_generations,
        },
    }
    return make_record(spec, status, metrics, levels, curves, b"", timing, devices, origin)


def why_diverged(trained: Trained) -> str:
    """Return what was not finite, as a clause; empty for a trial that has not diverged."""
    if not trained.finite:
        return "its function reported a number that is not finite"
    broken = [f"{name} = {value}" for name, value in trained.metrics.items() if not math.isfinite(value)]
    if broken:
        return f"its function returned {', '.join(broken)}"
    scores = () if trained.scores is None else (*trained.scores.success, *trained.scores.fitness)
    return "" if all(map(math.isfinite, scores)) else "the scores of its policy are not finite"


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

    def __init__(self, stored: StoredTrials, loop: TrainingLoop, devices: Sequence[jax.Device]) -> None:
        """Start nothing yet.

        Raises:
            UserError: when a package is missing that the loop declares, its arguments cannot be passed on, or its task
                has no horizon, without which no policy can be examined.
        """
        self._stored = stored
        self._devices = devices
        self._loop = loop
        missing = [name for name in loop.packages if stored.condition.versions[name] is None]
        if missing:
            raise UserError(
                f"The training loop {loop.name!r} needs {', '.join(missing)}, which is not "
                f"installed. Install it: pip install {' '.join(missing)}"
            )
        _ = stored.condition.task.horizon  # a task without one is refused before training, not after it
        self._request = {
            "function": loop.place,
            "task": to_plain(stored.condition.task),
            "budget": to_plain(stored.condition.budget),
            "settings": to_plain(dict(loop.settings)),
        }
        self._events: queue.SimpleQueue[RunningLoop | BaseException] = queue.SimpleQueue()
        self._lock = threading.Lock()  # of what follows
        self._children = set[Child]()
        self._stopping = False

    def make(self, owed: Sequence[int], tell: Watcher) -> None:
        """Run trials and store each as it ends; those that have ended stay when anything is raised."""
        running = [RunningLoop(TrialSpec(self._stored.condition, seed)) for seed in owed]
        began, stored = time.monotonic(), set[int]()
        with ThreadPoolExecutor(layout_on(self._devices[0].platform).threads(1)) as pool:
            try:
                for one in running:
                    pool.submit(self._attend, one)
                while len(stored) < len(running):
                    heard = next_of(self._events)
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
        timing = {"run": one.seconds, "compile": 0.0, "batch": 1, "started": one.began}
        ending = ""
        if isinstance(one.outcome, Trained):
            result = trained_record(one.spec, self._loop, one.outcome, one.curves, timing, self._devices)
            reason = why_diverged(one.outcome)
            ending = f"diverged: {reason}" if reason else ""
        elif isinstance(one.outcome, Failed):
            result = make_unfinished(one.spec, "crashed", one.curves, timing, self._devices, one.outcome.reason)
            failed.remember(result)
            ending = f"crashed: {failed.why(result)}"
        else:
            limit = self._stored.time_limit
            result = make_unfinished(one.spec, "timeout", one.curves, {**timing, "limit": limit}, self._devices)
            ending = f"is out of time after {limit:g} s"
        if ending:
            tell(RunProgress(self._stored.condition.label, f"seed {one.spec.seed} {ending}", 0, remark=True))
        self._stored.store.put(result, {})

    def _progress(self, running: Sequence[RunningLoop], ended: int, seconds: float) -> RunProgress:
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
