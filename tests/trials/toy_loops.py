"""Training loops that end in every way, and a task of no library that another process makes again."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from evoclaims.core.waiting import waiting

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
    """Return a metric (seed 0), raise (1), be killed (2), return a NaN (3), report one (4), return an infinity (5)."""
    for step in range(0, budget.environment_steps + 1, 10):
        report(step, fitness=float("nan") if (seed, step) == (4, 50) else seed + step / 100)
    print("what it prints is no answer")
    if seed == 1:
        raise ValueError("the reactor is \x1b[31mred")
    if seed == 2:
        os.kill(os.getpid(), signal.SIGSEGV)
    fitness = {3: float("nan"), 5: float("inf")}.get(seed, 7.5)
    return {"last_fitness": fitness, "jax": "jax" in sys.modules}


class Tensor:
    """A number as PyTorch has it, whose size is a method."""

    def size(self) -> tuple[int, ...]:
        return ()

    def item(self) -> float:
        return 0.25


def with_processes(task: Any, seed: int, budget: Any, report: Callable[..., None]) -> Mapping[str, float]:
    """Train with a process that is a fork of this one (seed 0), and be killed while such a one lives on (1)."""
    forks = multiprocessing.get_context("fork")
    if seed == 0:
        worker = forks.Process(target=os.getpid)
        worker.start()
        worker.join(10)
        return {"last_fitness": float(worker.exitcode == 0)}
    forks.Process(target=time.sleep, args=(600,)).start()
    os.kill(os.getpid(), signal.SIGKILL)
    return {}


def in_odd_ways(task: Any, seed: int, budget: Any, report: Callable[..., None], clip: float = 0.0) -> Mapping[str, Any]:
    """Return scalars of another library, after steps that are no point of the curve (seed 0); fail in odd ways.

    Seed 5 prints five megabytes, and dies.
    """
    if seed == 0:
        for step in (30, 50, 55):
            report(step, fitness=Tensor())
        return {"last_fitness": Tensor(), "unbounded": clip == float("inf")}
    if seed == 1:
        report(2**60, fitness=1.0)
    if seed == 5:
        for _ in range(50):
            print("x" * 100_000)
        print("the end")
        os._exit(3)
    if seed == 2:
        raise ValueError("x" * 1_000_000)
    return {"a name that is no \udc80 text": 1.0} if seed == 3 else {"read": float(input())}


def counts_less(task: Any, seed: int, budget: Any, report: Callable[..., None]) -> Mapping[str, float]:
    """Return fewer steps than it has reported (seed 0), or as many."""
    report(50, fitness=1.0)
    return {("steps" if budget.generations else "environment_steps"): 49.0 + seed, "last_fitness": 1.0}


def from_threads(task: Any, seed: int, budget: Any, report: Callable[..., None]) -> Mapping[str, float]:
    """Report long lines from several threads at once."""
    numbers = {f"number {n}": float(n) for n in range(800)}

    def told(first: int) -> None:
        for step in range(first, first + 4000, 50):
            report(step, **numbers)

    threads = [threading.Thread(target=told, args=(1000 * n,)) for n in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return {"last_fitness": 1.0}


def notes(task: Any, seed: int, budget: Any, report: Callable[..., None], file: str) -> Mapping[str, float]:
    """Note in a file that this seed has begun."""
    with open(file, "a") as begun:
        begun.write(f"{seed}\n")
    report(1, fitness=1.0)
    return {"last_fitness": 1.0}


def never_returns(task: Any, seed: int, budget: Any, report: Callable[..., None], file: str) -> Mapping[str, float]:
    """Start processes, one in a session of its own, note all in a file, report once, and never return."""
    started = [subprocess.Popen(SLEEP), subprocess.Popen(SLEEP, start_new_session=True)]
    Path(file).write_text(" ".join(str(pid) for pid in (os.getpid(), *(one.pid for one in started))))
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


def knows_by_text(task: Any, seed: int, budget: Any) -> tuple[Mapping[str, float], Callable[[Any], Any]]:
    """Return a table that is right, whose keys are texts."""
    import numpy as np

    def key(bits: Any) -> str:
        return str(np.round(bits))

    table = {key(row): 2.0 * right - 1.0 for row, right in zip(task.table.inputs, task.table.targets, strict=True)}
    return {"rows": float(len(table))}, lambda bits: table.get(key(bits), np.zeros(1) - 1.0)


def in_points(task: Any, seed: int, budget: Any, report: Callable[..., None], **metrics: float) -> Mapping[str, float]:
    """Return these metrics, and call one of them a success on the way (odd seeds)."""
    if seed % 2:
        report(20, success=max(metrics.values()))
    return metrics


def waits(task: Any, seed: int, budget: Any, report: Callable[..., None]) -> Mapping[str, float]:
    """Wait as for another process's kernel, once to the end, and once until it is killed (odd seeds)."""
    report(20, fitness=1.0)
    with waiting():
        if seed % 2:
            os.kill(os.getpid(), signal.SIGKILL)
    return {"last_fitness": 1.0}
