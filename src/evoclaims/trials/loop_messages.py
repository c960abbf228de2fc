"""What a training loop's process is asked, and what it answers: lines of JSON."""

from __future__ import annotations

import contextlib
import json
import os
import signal
from pathlib import Path
from typing import Any, Final

import msgspec

from evoclaims.core.canonical import as_plain
from evoclaims.core.printable import printable

_LAST_LINES: Final = 8
_LONGEST_LINE: Final = 500


class LoopRequest(msgspec.Struct, frozen=True):
    """One trial.

    Attributes:
        function: place of the training function, "module:name".
        task, budget, settings: its arguments (`core.portable`).
        seed: of the trial.
    """

    function: str
    task: Any
    budget: Any
    settings: Any
    seed: int


class LoopReport(msgspec.Struct, frozen=True, tag=True):
    """How far training is; `kept` says whether this is a point of the training curve."""

    step: int
    numbers: dict[str, float]
    kept: bool


class Waiting(msgspec.Struct, frozen=True, tag=True):
    """The process begins (`stopped`) or ceases to wait for another one: that is not the trial's time."""

    stopped: bool


class Scores(msgspec.Struct, frozen=True):
    """An examination of the final policy: success and fitness on each level, and the task's metrics on the last."""

    success: tuple[float, ...]
    fitness: tuple[float, ...]
    metrics: dict[str, float]


class Trained(msgspec.Struct, frozen=True, tag=True):
    """The trial's end.

    Attributes:
        metrics: as the function returned them.
        scores: None if it returned no policy.
        step: of its last report; None if it reported nothing.
        actions: hash of the policy's actions on fixed starts; empty without a policy.
        graded: whether one of these is no whole number.
        finite: whether all reported numbers were finite, also those that are no point of the curve.
    """

    metrics: dict[str, float]
    scores: Scores | None
    step: int | None
    actions: str = ""
    graded: bool = False
    finite: bool = True


class Failed(msgspec.Struct, frozen=True, tag=True):
    """The function has raised an exception; `reason` is the end of its traceback."""

    reason: str


Answer = LoopReport | Waiting | Trained | Failed


def encode(message: LoopRequest | Answer) -> bytes:
    """Return a message as one line of JSON, in which NaN and the infinities are words."""
    return json.dumps(as_plain(msgspec.to_builtins(message)), allow_nan=False).encode("ascii") + b"\n"


def decode(line: bytes) -> Answer:
    """Return the answer in a line; raise a `msgspec.MsgspecError` if it is torn."""
    answer: Answer = msgspec.json.decode(line, type=Answer, strict=False)  # "nan" is a float
    return answer


def last_lines(text: str) -> str:
    """Return how much of a traceback, or of a process's last output, is kept as the reason of a crash."""
    lines = [line.rstrip() for line in text.splitlines() if line.strip()]
    return "\n".join(printable(line)[:_LONGEST_LINE] for line in lines[-_LAST_LINES:])


MARK: Final = "EVOCLAIMS_TRIAL_PROCESS"
"""Variable that a trial's process hands down; its value is of one trial."""


def end_marked(value: str) -> None:
    """Kill all processes with this value of the mark but this one; on Linux alone, whose /proc shows environments."""
    wanted = f"{MARK}={value}".encode()
    for _ in range(3):  # one may start another meanwhile
        found = [pid for pid in _processes() if pid != os.getpid() and wanted in _environment(pid)]
        for pid in found:
            with contextlib.suppress(OSError):
                os.kill(pid, signal.SIGKILL)
        if not found:
            return


def _processes() -> list[int]:
    try:
        return [int(name) for name in os.listdir("/proc") if name.isdecimal()]
    except OSError:
        return []


def _environment(pid: int) -> list[bytes]:
    """Return the variables that a process was started with; none where it is gone, or another user's."""
    try:
        return Path(f"/proc/{pid}/environ").read_bytes().split(b"\0")
    except OSError:
        return []
