"""The paper whose claims are judged while everything goes wrong: toy trials that last long enough to be hit.

It is imported by the processes under attack. They say what they do in a log, one JSON object a line, and rest at every
report, since a trial that spins in place of resting would only take the cores from the other processes. While a file
says so, they rest after a report until it is gone: so an attack finds them in the middle on a machine of any speed.
"""

from __future__ import annotations

import json
import os
import socket
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tortured_project import REPORTS, TRIALS
from trial_toys import Walker

from evoclaims.claims import fetching
from evoclaims.envs.gates.parity import NParity
from evoclaims.judging.design import Design
from evoclaims.methods.base import Method
from evoclaims.paper.reproduction import Reproduction, Tier
from evoclaims.trials.progress import RunProgress, Watcher
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Budget, Condition
from evoclaims.trials.store import Store

METHODS: dict[str, Method[Any]] = {
    "quick": Walker(chance=0.09),
    "steady": Walker(chance=0.03),
    "fragile": Walker(0.03, hazard=0.004),
}
CONDITIONS = {
    (name, "parity"): Condition(method, NParity(4), "curriculum", Budget(generations=100, reports=REPORTS))
    for name, method in METHODS.items()
}
REPRODUCTION = Reproduction(
    name="tortured",
    title="A Paper That Is Judged All the Same",
    folder=Path(__file__).parent,
    tiers={name: Tier(CONDITIONS, Design.fixed(TRIALS)) for name in ("smoke", "full")},
)

_log = os.open(os.environ["TORTURE_LOG"], os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
_held = Path(f"{os.environ['TORTURE_LOG']}-held-{os.getpgrp()}")
_pause = float(os.environ.get("TORTURE_PAUSE", "0"))


def say(what: str, **fields: Any) -> None:
    line = {"what": what, "pid": os.getpid(), "host": socket.gethostname(), **fields}
    os.write(_log, (json.dumps(line) + "\n").encode())


_run, _put = fetching.run, Store.put


def _slowly(
    condition: Condition, seeds: Sequence[int], store: Store, devices: Any, watch: Watcher, **options: Any
) -> Any:
    """Run as ever, with a checkpoint after every chunk, and rest after each."""

    def told(progress: RunProgress) -> None:
        watch(progress)
        say(progress.phase.split()[0], condition=condition.id, steps=progress.steps)
        time.sleep(_pause)
        while progress.phase == "training" and _held.exists():
            time.sleep(0.02)

    return _run(condition, seeds, store, devices, told, checkpoint_seconds=0.0, **options)


def _telling(store: Store, result: TrialResult, champion: Any) -> Any:
    became = _put(store, result, champion)
    say("put", condition=result.condition, id=result.id, became=became)
    return became


fetching.run = _slowly  # type: ignore[assignment]
Store.put = _telling  # type: ignore[method-assign]
