"""The process of one trial of a training loop: `python -m evoclaims.trials.loop_process`.

It reads a `Request` from its standard input, calls the function, examines the policy that this returns, and answers on
its standard output. When its standard input ends, its parent is gone, and it ends with all that it has started.
"""

from __future__ import annotations

import math
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Mapping
from numbers import Real
from typing import Any, Final

import msgspec

from evoclaims.core.errors import UserError
from evoclaims.core.portable import from_plain, resolve
from evoclaims.core.printable import printable
from evoclaims.envs.foreign.scoring import NativelyExamined
from evoclaims.methods.training_loop import wants_report
from evoclaims.trials.loop_messages import LAST_LINES, Answer, Failed, Reported, Request, Scores, Trained, encode

COUNTS: Final = ("steps", "environment_steps")
"""Metrics that are counts; all others are any numbers."""

TOLD_SECONDS: Final = 0.2
"""Least time between two reports that are passed on, but for the points of the curve."""


class Reporter:
    """The function `report` of a trial."""

    def __init__(self, every: int, answer: Callable[[Answer], None]) -> None:
        """Keep about one point of the curve for each `every` steps: which ones depends on steps alone."""
        self._every = max(every, 1)
        self._answer = answer
        self._next = 0
        self._told = -math.inf

    def __call__(self, step: int, **values: Any) -> None:
        """Tell how far training is, in the budget's unit, and numbers such as `fitness=12.5`."""
        step, kept = int(step), int(step) >= self._next
        if not kept and time.monotonic() - self._told < TOLD_SECONDS:
            return
        if kept:
            self._next = (step // self._every + 1) * self._every
        self._told = time.monotonic()
        self._answer(Reported(step, numbers(values), kept))


def numbers(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return a training loop's numbers as floats.

    Raises:
        UserError: when one is no number, or a count that is none.
    """
    if not isinstance(values, Mapping):
        raise UserError(f"A training function returns a table of numbers by name, or (table, policy), not {values!r}.")
    found = {}
    for name, value in values.items():
        number = value.item() if getattr(value, "size", 0) == 1 else value  # NumPy's, PyTorch's and jax's scalars
        if not isinstance(name, str) or not isinstance(number, Real):
            raise UserError(f"A training loop's metrics are numbers by name, and {name!r} is {value!r}.")
        if name in COUNTS and not 0 <= float(number) <= 2**53:
            raise UserError(f"A training loop's {name} is a number of steps, and not {value!r}.")
        found[name] = float(number)
    return found


def train(request: Request, answer: Callable[[Answer], None]) -> Trained:
    """Call the function, and examine its policy."""
    function, task, budget = resolve(request.function), from_plain(request.task), from_plain(request.budget)
    told = {"report": Reporter(budget.chunk(1), answer)} if wants_report(function) else {}
    returned = function(task, request.seed, budget, **from_plain(request.settings), **told)
    metrics, policy = returned if isinstance(returned, tuple) and len(returned) == 2 else (returned, None)
    scores = None if policy is None else examined(task, policy, request.seed)
    return Trained(numbers(metrics), scores)


def examined(task: Any, policy: Callable[[Any], Any], seed: int) -> Scores:
    """Return the scores of a policy, which acts on another library's environment as that wants it."""
    if isinstance(task, NativelyExamined):
        fitness, success, metrics = task.examine_natively(policy, seed)
        return Scores(success=(success,), fitness=(fitness,), metrics=dict(metrics))
    from evoclaims.trials import loop_examination  # not before: many loops need no jax

    return loop_examination.examined(task, policy, seed)


def main() -> None:
    """Run the trial that standard input asks for; an exception is an answer, too."""
    replies = os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(2, 1)  # what the function prints is no answer
    request = msgspec.json.decode(sys.stdin.buffer.readline(), type=Request)
    threading.Thread(target=_end_with_parent, daemon=True).start()

    def answer(message: Answer) -> None:
        replies.write(encode(message))

    try:
        answer(train(request, answer))
    except BaseException as error:
        lines = "".join(traceback.format_exception(error)).splitlines()
        answer(Failed("\n".join(map(printable, lines[-LAST_LINES:]))))
        os._exit(1)
    os._exit(0)  # threads of the function do not keep the process


def _end_with_parent() -> None:
    """Wait for the end of standard input, and end the processes of this group: this one, and what it has started."""
    sys.stdin.buffer.read()
    os.killpg(os.getpgrp(), signal.SIGKILL)


if __name__ == "__main__":
    main()
