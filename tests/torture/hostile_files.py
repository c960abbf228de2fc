"""What others may do to a machine's files and locks: stopped compilers, files of evidence, full caches, containers."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import time
from pathlib import Path

from bench import Bench, Laboratory, Running, until
from full_disk import NoSmallDiskError, small_disk
from guard import Guard
from tally import Tally

NAMES = ("quick", "steady", "fragile", "quick-steady", "steady-fragile")
"""The claims of the tortured paper, whose files of evidence have their names."""


def attack_compiler(laboratory: Laboratory, times: int, draw: random.Random) -> Tally:
    """Stop a process that holds the lock of what it compiles, while another, with another store, wants the same."""
    tally = Tally("a compiler that is stopped")
    for _ in range(times):
        with laboratory.bench() as bench:
            guard = Guard(bench, laboratory.truth, tally)
            cache = bench.folder / "cache"
            holder = _lock_holder(bench, cache)
            try:
                os.kill(holder.pid, signal.SIGSTOP)
                tally.done["locks held by a stopped process"] += 1
                code = (
                    "import jax; from evoclaims.kernels.emit import machine_code\n"
                    "machine_code.PATIENCE = 1.0\n"
                    f"jax.config.update('jax_compilation_cache_dir', {str(cache)!r})\n"
                    "text = 'define i32 @f(i32 %x) {\\n ret i32 %x\\n}\\n'\n"
                    "assert machine_code.address(text, 'f')\n"
                )
                waiting = bench.python(code)
                tally.demand(waiting.end() == 0, f"it ended with {waiting.process.returncode}: {waiting.output}")
                guard.plainly(waiting)
            finally:
                holder.kill()
                holder.wait()
            guard.judged(_whole(bench, guard))
            guard.finish()
    return tally


def _lock_holder(bench: Bench, cache: Path) -> subprocess.Popen[str]:
    """Start a process that has the kernel's lock, as one within LLVM has."""
    code = (
        "import sys, time, filelock\nfrom pathlib import Path\n"
        "from evoclaims.core.files import make_private\nfrom evoclaims.kernels.emit import machine_code\n"
        f"folder = Path({str(cache)!r}) / 'kernels'\nmake_private(folder)\nmachine_code.lanes()\n"
        "text = 'define i32 @f(i32 %x) {\\n ret i32 %x\\n}\\n'\n"
        "machine_code._target()\n"
        "lock = filelock.FileLock(folder / (machine_code.key_of(text) + '.lock'))\nlock.acquire()\n"
        "print('held', flush=True)\ntime.sleep(600)\n"
    )
    running = bench.python(code)
    until(lambda: "held" in running.output or running.process.poll() is not None, "a lock that is held")
    assert running.process.poll() is None, running.output
    return running.process  # type: ignore[return-value]


def attack_evidence(laboratory: Laboratory, times: int, draw: random.Random) -> Tally:
    """Put pipes, endless devices and brackets into the places of evidence, and judge."""
    tally = Tally("hostile files of evidence")
    for _ in range(times):
        with laboratory.bench(pause=0.0) as bench:
            guard = Guard(bench, laboratory.truth, tally)
            folder = bench.store / "verdicts" / "smoke"
            folder.mkdir(parents=True)
            for name in NAMES:
                kind = draw.choice(["pipe", "device", "brackets", "circle"])
                _plant(folder / f"{name}.json", kind)
                tally.done[kind] += 1
            running = bench.pytest(0)
            status = running.end()
            tally.demand(status in (0, 1), f"it ended with status {status}")
            guard.plainly(running)
            guard.judged(running)
            guard.finish()
    return tally


def _plant(path: Path, kind: str) -> None:
    """Put something odd into a place."""
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "brackets":
        path.write_text("[" * 200_000 + "]" * 200_000)
    else:
        path.symlink_to("/dev/zero" if kind == "device" else path.name)


def attack_container(laboratory: Laboratory, times: int, draw: random.Random) -> Tally:
    """Share a store between this machine and a container that has its name and processes of its own."""
    tally = Tally("a container with the host's name")
    inside = ["unshare", "--pid", "--fork", "--mount-proc"]
    if (
        shutil.which("unshare") is None
        or subprocess.run([*inside, "true"], capture_output=True, check=False).returncode
    ):
        tally.notes.append("this system lets no process have a process namespace of its own")
        return tally
    for _ in range(times):
        with laboratory.bench(pause=0.06, lease=60.0) as bench:
            guard = Guard(bench, laboratory.truth, tally)
            outside = bench.evoclaims("run")
            with bench.held(outside):
                bench.until_said("training", outside)
                within = bench.evoclaims("run", wrapped=inside)
                until(
                    lambda within=within: _waits(bench) or within.process.poll() is not None,
                    "a container that waits for the host",
                )
                time.sleep(draw.uniform(0.0, 0.5))
            tally.done["stores shared with a container"] += 1
            for running in (outside, within):
                tally.demand(running.end() == 0, f"it ended with status {running.process.returncode}")
                guard.plainly(running)
            guard.finish()
    return tally


def _waits(bench: Bench) -> bool:
    """Whether some process has said that it waits; numbers of processes mean nothing in a container."""
    return any(line["what"] == "waiting" for line in bench.events())


def attack_full_cache(laboratory: Laboratory, times: int, draw: random.Random) -> Tally:
    """Fill the disk of the cache of compiled programs; with space again, all is compiled once and kept."""
    tally = Tally("a cache on a full disk")
    try:
        for _ in range(times):
            with laboratory.bench(pause=0.0) as bench, small_disk(bench.folder / "cache"):
                filler = bench.folder / "cache" / "filler"
                guard = Guard(bench, laboratory.truth, tally)
                filler.write_bytes(bytes((1 << 20) - draw.randrange(1, 10) * 4096))
                _judged_with_cache(bench, guard)
                filler.unlink()
                _judged_with_cache(bench, guard)
                torn = [path for path in (bench.folder / "cache").glob("*-cache") if not path.stat().st_size]
                tally.demand(not torn, f"{len(torn)} empty entries stay in the cache")
                tally.done["caches"] += 1
                guard.finish()
    except NoSmallDiskError as error:
        tally.notes.append(str(error))
    return tally


def _judged_with_cache(bench: Bench, guard: Guard) -> None:
    """Run everything anew with the bench's own cache."""
    shutil.rmtree(bench.store, ignore_errors=True)
    (bench.folder / "log").unlink(missing_ok=True)
    bench.forget_events()
    guard.forget()
    running = bench.pytest(0, cache=bench.folder / "cache")
    status = running.end()
    guard.tally.demand(status in (0, 1), f"it ended with status {status}")
    guard.plainly(running)
    guard.judged(running)


def _whole(bench: Bench, guard: Guard) -> Running:
    """Run everything to its end."""
    running = bench.pytest(0)
    running.end()
    guard.plainly(running)
    return running
