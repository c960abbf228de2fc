"""The process that test_kill.py kills: runs toy trials slowly and says what it does, one line at a time."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from typing import Any

import jax
from trial_toys import walk

from evoclaims.trials.progress import RunProgress
from evoclaims.trials.result import TrialResult
from evoclaims.trials.runner import run
from evoclaims.trials.store import Store

CONDITION = walk(chance=0.03, hazard=0.002, steps=120, reports=60)
SEEDS = range(6)


def _say(line: str) -> None:
    os.write(1, f"{line}\n".encode())


def _watch(progress: RunProgress) -> None:
    """Report, and take long enough that a kill comes at any moment of the run rather than after it."""
    _say(f"{progress.phase} {progress.steps}")
    time.sleep(0.03)


def main(root: str) -> None:
    put = Store.put

    def telling(store: Store, result: TrialResult, champion: Any) -> Any:
        became = put(store, result, champion)
        _say(f"put {result.seed} {became}")
        return became

    Store.put = telling  # type: ignore[method-assign]
    jax.devices()
    _say("ready")
    sys.stdin.readline()
    results = run(CONDITION, SEEDS, Store(Path(root)), jax.devices("cpu")[:2], _watch, checkpoint_seconds=0.0)
    _say("digests " + " ".join(result.digest for result in results))


if __name__ == "__main__":
    main(sys.argv[1])
