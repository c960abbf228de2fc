"""The process of one trial of a training loop: `python -m evoclaims.trials.loop_process`.

It reads a `LoopRequest` from its standard input, calls the function, examines the policy that this returns, and answers
on its standard output. When its standard input ends, its parent is gone, and it ends with all that it has started.
"""

from __future__ import annotations

import contextlib
import copy
import io
import math
import os
import signal
import threading
import time
import traceback
from collections.abc import Callable, Iterable, Mapping
from numbers import Real
from pathlib import Path
from typing import Any, Final

import msgspec

from evoclaims.core.canonical import as_plain, content_hash
from evoclaims.core.errors import UserError
from evoclaims.core.portable import from_plain, resolve
from evoclaims.core.waiting import report_to
from evoclaims.envs.foreign.scoring import ForeignTask
from evoclaims.methods.training_loop import wants_report
from evoclaims.trials.loop_messages import (
    MARK,
    Answer,
    Failed,
    LoopReport,
    LoopRequest,
    Scores,
    Trained,
    Waiting,
    encode,
    end_marked,
    last_lines,
)
from evoclaims.trials.result import check_shares, check_success

COUNTS: Final = ("steps", "environment_steps")
"""Metrics that are counts; all others are any numbers."""

TOLD_SECONDS: Final = 0.2
"""Least time between two reports that are passed on, but for the points of the curve."""

WATCHED: Final = 64
"""Most actions by which policies are distinguished."""

FIXED_START: Final = 2**31 - 1
"""The seed of the starts from which these are watched, the same for every trial."""

MOST_STEPS: Final = 2**53
"""What a count may be at most, as in records: a float holds it exactly."""


class Reporter:
    """The function `report` of a trial.

    Attributes:
        last: the largest step of a report, passed on or not; None before the first.
        finite: whether all reported numbers were.
    """

    def __init__(self, every: int, answer: Callable[[Answer], None]) -> None:
        """Keep about one point of the curve for each `every` steps: which ones depends on steps alone."""
        self._every = max(every, 1)
        self._answer = answer
        self._next = 0
        self._told = -math.inf
        self._of_thread = threading.local()
        self.last: int | None = None
        self.finite = True

    def __call__(self, step: int, **values: Any) -> None:
        """Tell how far training is, in the budget's unit, and numbers such as `fitness=12.5`.

        Raises:
            UserError: when the step is not a count or falls, a value is not a number, or the success is not a share.
        """
        if step != int(step):
            raise UserError(f"A training function reports {step!r} steps. Report a whole number.")
        step = int(step)
        if not 0 <= step <= MOST_STEPS:
            raise UserError(f"A training function reports {step} steps. Report a number from 0 to {MOST_STEPS}.")
        before = getattr(self._of_thread, "step", 0)
        if step < before:  # a counter that begins again would hide what was spent
            raise UserError(
                f"A training function reports step {step} after step {before}. Report the steps since training began, "
                "which never fall."
            )
        self._of_thread.step = step
        self.last = max(step, self.last or 0)
        given = numbers(values)
        self.finite = self.finite and all(map(math.isfinite, given.values()))
        check_success("A training loop", given.get("success", 0.0), solves=False, advice="report such a share")
        kept = step >= self._next
        if not kept and time.monotonic() - self._told < TOLD_SECONDS:
            return
        if kept:
            self._next = (step // self._every + 1) * self._every
        self._told = time.monotonic()
        self._answer(LoopReport(step, given, kept))


def numbers(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return a training loop's numbers as floats.

    Raises:
        UserError: when one is not a number, or not a count.
    """
    if not isinstance(values, Mapping):
        raise UserError(f"A training function returns a table of numbers by name, or (table, policy), not {values!r}.")
    found = {}
    for name, value in values.items():
        number = _scalar(value)
        if not isinstance(name, str) or not name.isprintable() or not isinstance(number, Real):
            raise UserError(f"A training loop's metrics are numbers by name, and {name!r} is {value!r}.")
        if name in COUNTS and not 0 <= float(number) <= MOST_STEPS:
            raise UserError(f"A training loop's {name} is a number of steps, not {value!r}.")
        found[name] = float(number)
    return found


def _scalar(value: Any) -> Any:
    """Return the number in an array of NumPy, PyTorch or jax that holds one; anything else as it is."""
    try:
        return value.item()
    except (AttributeError, TypeError, ValueError, RuntimeError):  # as each of them refuses an array of several
        return value


def train(request: LoopRequest, answer: Callable[[Answer], None]) -> Trained:
    """Call the function, and examine its policy."""
    function, task, budget = resolve(request.function), from_plain(request.task), from_plain(request.budget)
    report = Reporter(budget.chunk(1), answer)
    given = {"report": report} if wants_report(function) else {}
    returned = function(task, request.seed, budget, **from_plain(request.settings), **given)
    metrics, policy = returned if isinstance(returned, tuple) and len(returned) == 2 else (returned, None)
    told_metrics = numbers(metrics)
    counted = "environment_steps" if budget.generations is None else "steps"
    if told_metrics.get(counted, math.inf) < (report.last or 0):
        raise UserError(
            f"A training function returns {told_metrics[counted]:.0f} {counted} and has reported {report.last}. Return "
            "all that it has made, or leave the metric out: the last report counts then."
        )
    if policy is not None and not callable(policy):
        raise UserError(f"A policy is {policy!r}. It must be a function from an observation to an action.")
    if policy is None:
        check_shares("A training loop", told_metrics, "return such a share, or give the metric another name")
        return Trained(told_metrics, None, report.last, finite=report.finite)
    actions, graded = actions_of(task, policy)  # before the examination, which may change what a policy draws from
    scores = examined(task, policy, request.seed)
    check_success("The examination of a training loop's policy", *scores.success, advice="make the task's such a share")
    return Trained(told_metrics, scores, report.last, actions, graded, report.finite)


def actions_of(task: Any, policy: Callable[[Any], Any]) -> tuple[str, bool]:
    """Return the hash of a policy's actions on fixed starts, and whether some number in them is not whole.

    Policies with other parameters nearly always differ here, and copies of one never do, whatever their seeds.

    Raises:
        UserError: when a policy acts otherwise on the same observations again: its score would be one of many.
    """
    seen: list[Any] = []
    observations: list[Any] = []

    def watched(observation: Any) -> Any:
        if len(seen) == WATCHED:
            raise _EnoughError
        held = copy.deepcopy(observation)  # which an environment may overwrite
        action = policy(observation)
        seen.append(_plain_action(action))
        observations.append(held)
        return action

    try:
        if isinstance(task, ForeignTask):
            task.examine_natively(watched, FIXED_START)
        else:
            from evoclaims.trials import loop_examination

            for observation in loop_examination.fixed_observations(task, WATCHED):
                watched(observation)
    except _EnoughError:
        pass
    except Exception as error:  # a policy may be a table without these observations
        seen.append(type(error).__name__)
    _check_again(policy, zip(observations, seen, strict=False))
    graded = any(isinstance(x, float) and math.isfinite(x) and x % 1 != 0 for one in seen for x in one)
    return content_hash(as_plain(seen)), graded


def _check_again(policy: Callable[[Any], Any], seen: Iterable[tuple[Any, Any]]) -> None:
    """Check that a policy acts on observations as it did before, but for rounding."""
    import numpy as np

    for observation, before in seen:
        again = _plain_action(policy(observation))
        words = isinstance(before, str) or isinstance(again, str) or len(again) != len(before)
        if again != before if words else not np.allclose(again, before, rtol=1e-3, atol=1e-5, equal_nan=True):
            raise UserError(
                f"A policy's action is {before} first and {again} later, on the same observation. It must be a "
                "function of the observation alone, without randomness and memory: take the likeliest action or the "
                "mean."
            )


class _EnoughError(Exception):
    """As many actions as are needed have been seen."""


def _plain_action(action: Any) -> list[float] | str:
    """Return an action's numbers; of an action that is no array, its text."""
    import numpy as np

    try:
        return [float(number) for number in np.ravel(np.asarray(action))]
    except (TypeError, ValueError):
        return repr(action)


def examined(task: Any, policy: Callable[[Any], Any], seed: int) -> Scores:
    """Return the scores of a policy, which acts on another library's environment as that wants it."""
    if isinstance(task, ForeignTask):
        fitness, success, metrics = task.examine_natively(policy, seed)
        return Scores(success=(success,), fitness=(fitness,), metrics=dict(metrics))
    from evoclaims.trials import loop_examination  # not before: many loops need no jax

    return loop_examination.examined(task, policy, seed)


def main() -> None:
    """Run the trial that standard input asks for; an exception is an answer, too."""
    asked, replies, one_at_a_time = _requests(), os.fdopen(os.dup(1), "wb", buffering=0), threading.Lock()
    os.dup2(2, 1)  # what the function prints is no answer
    os.register_at_fork(after_in_child=replies.close)  # else the pipe does not end with this process
    request = msgspec.json.decode(asked.readline(), type=LoopRequest)
    threading.Thread(target=_end_with_parent, args=(asked.detach(),), daemon=True).start()

    def answer(message: Answer) -> None:
        line = memoryview(encode(message))
        with one_at_a_time:  # threads of the function may report, too
            while line:
                line = line[replies.write(line) :]

    def wait(stopped: bool) -> None:
        with contextlib.suppress(OSError, ValueError):  # in a process that the function has forked
            answer(Waiting(stopped))

    report_to(wait)
    try:
        answer(train(request, answer))
    except BaseException as error:
        answer(Failed(last_lines(_told(error))))
        os._exit(1)
    os._exit(0)  # threads of the function do not keep the process


def _told(error: BaseException) -> str:
    """Return an exception with its traceback; of a user's error the message, after the lines of the user's own code."""
    if not isinstance(error, UserError):
        return "".join(traceback.format_exception(error))
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if not Path(frame.filename).is_relative_to(Path(__file__).parents[1])]
    return "".join(traceback.format_list(own)) + str(error)


def _requests() -> io.BufferedReader:
    """Return standard input, and leave the function an empty one, on which no thread waits and holds a lock."""
    asked = os.fdopen(os.dup(0), "rb")
    empty = os.open(os.devnull, os.O_RDONLY)
    os.dup2(empty, 0)
    os.close(empty)
    return asked


def _end_with_parent(asked: io.RawIOBase) -> None:
    """Wait for the end of the requests, and end the processes of this group: this one, and what it has started."""
    while asked.read(1):
        pass
    end_marked(os.environ.get(MARK, "none"))
    os.killpg(os.getpgrp(), signal.SIGKILL)


if __name__ == "__main__":
    main()
