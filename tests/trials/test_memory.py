"""What a batch leaves behind goes back to the system."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest
from climbers import run_climbers

from evoclaims.trials import memory
from evoclaims.trials.store import Store

pytestmark = pytest.mark.oldest


def test_memory_is_given_back_at_the_end_of_a_batch(
    tmp_path: Path, cpus: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[int] = []
    monkeypatch.setattr(memory, "_trim", lambda: calls.append)
    run_climbers(Store(tmp_path), cpus)
    assert calls == [0]
    run_climbers(Store(tmp_path), cpus)  # nothing was to be run
    assert calls == [0]


@pytest.mark.skipif(sys.platform != "linux", reason="glibc's allocator alone keeps what was freed")
def test_freed_memory_goes_back_to_the_system() -> None:
    if memory._trim() is None:
        pytest.skip("another C library")

    def resident() -> int:
        return int(Path("/proc/self/statm").read_text().split()[1]) * 4096

    memory.give_back()
    held = [bytes(10_000) for _ in range(20_000)]  # smaller than what is mapped by itself
    last = bytearray(10_000)  # keeps the heap from shrinking by itself
    full = resident()
    del held
    memory.give_back()
    assert resident() < full - 100_000_000
    del last
