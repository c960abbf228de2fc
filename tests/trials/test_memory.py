"""What compiling and a batch leave behind goes back to the system."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from climbers import run_climbers

from evoclaims.trials import devices
from evoclaims.trials.lanes import Lanes
from evoclaims.trials.store import Store

pytestmark = pytest.mark.oldest


def test_memory_is_given_back_after_compiling_and_at_the_end_of_a_batch(
    tmp_path: Path, cpus: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    events: list[str] = []
    monkeypatch.setattr(devices, "_libc", lambda: SimpleNamespace(malloc_trim=lambda _: events.append("trim")))
    for name in ("_lowered", "_finished", "advance"):
        monkeypatch.setattr(Lanes, name, noted(getattr(Lanes, name), name, events))
    run_climbers(Store(tmp_path), cpus)
    repeated, start = ["_lowered"] * 2 + ["trim"] + ["_finished"] * 2 + ["trim"], ["_lowered", "_finished", "trim"]
    assert [event for event in events if event != "advance"] == [*repeated, *start, "trim"]
    assert events[-2:] == ["advance", "trim"]
    run_climbers(Store(tmp_path), cpus)  # nothing was to be run
    assert events.count("trim") == 4


def noted(function: Any, name: str, events: list[str]) -> Any:
    """Return a function that notes each call."""

    def called(*arguments: Any, **options: Any) -> Any:
        events.append(name)
        return function(*arguments, **options)

    return called


HEAPS = """
import ctypes, threading
from evoclaims.trials import devices

devices.share_heaps()
libc, all_there = ctypes.CDLL(None), threading.Barrier(8)
libc.fopen.restype = ctypes.c_void_p

def work():
    libc.malloc(5000)
    all_there.wait()

threads = [threading.Thread(target=work) for _ in range(8)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
libc.malloc_info(0, ctypes.c_void_p(libc.fopen(b"/dev/stdout", b"w")))
libc.fflush(None)
"""


def test_threads_share_two_heaps(monkeypatch: pytest.MonkeyPatch) -> None:
    if devices._libc() is None:
        pytest.skip("another C library")

    told = subprocess.run([sys.executable, "-c", HEAPS], capture_output=True, text=True, check=True).stdout
    assert told.count("<heap nr=") == 2
    calls: list[tuple[int, int]] = []
    monkeypatch.setattr(devices, "_libc", lambda: SimpleNamespace(mallopt=lambda *which: calls.append(which)))
    devices.configure()  # before jax makes its threads
    assert calls == [(-8, 2)]
