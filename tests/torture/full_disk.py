"""A disk that fills up in the middle of trials, and has space again when the same command is called once more."""

from __future__ import annotations

import os
import random
import resource
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from bench import Bench, Laboratory, Running
from guard import Guard
from tally import Tally
from tortured_project import REPORTS

SIZE = 1 << 20
"""Bytes of the small disk: a store of the toy trials takes about half of it."""


class NoSmallDiskError(Exception):
    """This system does not let anybody mount a small disk; the message is what it says."""


@contextmanager
def small_disk(folder: Path) -> Iterator[None]:
    """Mount a small disk at a folder."""
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", f"size={SIZE}", "torture", str(folder)]
    try:
        subprocess.run(command, check=True, capture_output=True, text=True)
    except (OSError, subprocess.CalledProcessError) as error:
        raise NoSmallDiskError(f"no small disk can be mounted here: {getattr(error, 'stderr', '') or error}") from error
    try:
        yield
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)


def fill(bench: Bench, running: Running, draw: random.Random) -> Callable[[], None]:
    """Fill the disk up to a few bytes, and return what frees it again."""
    filler = bench.store / "filler"
    with filler.open("wb", buffering=0) as file:
        try:
            while True:
                file.write(bytes(1 << 12))
        except OSError:
            os.ftruncate(file.fileno(), max(file.tell() - draw.randrange(0, 3 << 12), 0))
    return filler.unlink


def limit(bench: Bench, running: Running, draw: random.Random) -> Callable[[], None]:
    """Let no process of a command write a file of more than some bytes: for it, the disk is full."""
    for pid in {line["pid"] for line in bench.said("training", running)}:
        # More than a run prints, less than a checkpoint takes, and about what a record does.
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (draw.randrange(2500, 5000), resource.RLIM_INFINITY))
    return lambda: None


def attack_mounted(laboratory: Laboratory, times: int, draw: random.Random, workers: int = 2) -> Tally:
    """Fill a real disk under `pytest -n 2`."""
    tally = Tally("a small disk that fills up")
    try:
        for _ in range(times):
            with laboratory.bench() as bench, small_disk(bench.store):
                start = partial(bench.pytest, workers)
                ended = _filled(
                    bench, start, fill, "No space left on device", draw, Guard(bench, laboratory.truth, tally)
                )
                Guard(bench, laboratory.truth, tally).judged(ended)
    except NoSmallDiskError as error:
        tally.notes.append(str(error))
    return tally


def attack_limited(laboratory: Laboratory, times: int, draw: random.Random) -> Tally:
    """Take the right to write away from `evoclaims run`, where no disk can be mounted."""
    tally = Tally("a process that may write no longer")
    for _ in range(times):
        with laboratory.bench() as bench:
            start = partial(bench.evoclaims, "run")
            _filled(bench, start, limit, "File too large", draw, Guard(bench, laboratory.truth, tally))
    return tally


def _filled(
    bench: Bench,
    start: Callable[[], Running],
    strike: Callable[[Bench, Running, random.Random], Callable[[], None]],
    sentence: str,
    draw: random.Random,
    guard: Guard,
) -> Running:
    """Start, fill the disk in the middle, read the sentence, free the disk, and start again; return the last run."""
    running = start()
    bench.until_said("training", running, times=draw.randrange(3) * REPORTS + draw.randrange(1, REPORTS // 2))
    with bench.held(running):
        free = strike(bench, running, draw)
    status = running.end()
    guard.tally.done["times full"] += 1
    guard.tally.demand(status != 0, "it ended with status 0")
    guard.plainly(running, sentence)
    guard.look()
    free()
    running = start()
    status = running.end()
    guard.tally.demand(status in (0, 1), f"with space again it ended with status {status}")
    guard.plainly(running)
    guard.finish()
    return running
