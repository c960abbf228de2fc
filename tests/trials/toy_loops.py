"""Training loops that end in every way, and a task of no library that another process makes again."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

SLEEP = [sys.executable, "-c", "import time; time.sleep(600)"]


@dataclass(frozen=True)
class Nowhere:
    """A task that nobody acts in: its training loops say how well they did."""

    name: ClassVar[str] = "nowhere"
    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ()
    levels: ClassVar[int] = 1
    action_size: ClassVar[int] = 1
    observation_size: ClassVar[int] = 1
    horizon: ClassVar[int] = 10


def in_every_way(task: Any, seed: int, budget: Any, report: Callable[..., None]) -> Mapping[str, float]:
    """Return a metric (seed 0), raise (1), be killed (2), return a NaN (3)."""
    for step in range(0, budget.environment_steps + 1, 10):
        report(step, fitness=seed + step / 100)
    print("what it prints is no answer")
    if seed == 1:
        raise ValueError("the reactor is \x1b[31mred")
    if seed == 2:
        os.kill(os.getpid(), signal.SIGSEGV)
    return {"last_fitness": float("nan") if seed == 3 else 7.5, "found": float("inf")}


def notes(task: Any, seed: int, budget: Any, report: Callable[..., None], file: str) -> Mapping[str, float]:
    """Note in a file that this seed has begun."""
    with open(file, "a") as begun:
        begun.write(f"{seed}\n")
    report(1, fitness=1.0)
    return {"last_fitness": 1.0}


def never_returns(task: Any, seed: int, budget: Any, report: Callable[..., None], file: str) -> Mapping[str, float]:
    """Start another process, note both in a file, report once, and never return."""
    started = subprocess.Popen(SLEEP)
    Path(file).write_text(f"{os.getpid()} {started.pid}")
    report(20, fitness=3.0)
    time.sleep(600)
    return {}


def knows_parity(task: Any, seed: int, budget: Any) -> tuple[Mapping[str, float], Callable[[Any], Any]]:
    """Return a policy in NumPy that is right, or in jax that is wrong (odd seeds)."""
    import jax.numpy as jnp
    import numpy as np

    if seed % 2:
        return {"last_success": 1.0}, lambda bits: jnp.zeros(1) - 1.0
    return {"rows": 8.0}, lambda bits: np.array([1.0 if int(np.asarray(bits).sum()) % 2 else -1.0])
