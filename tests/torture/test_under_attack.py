"""Nothing is lost, repeated or judged otherwise, whatever becomes of processes and disks.

Some of the attacks in small; `python tests/torture/run.py` makes all of them in large.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import full_disk
import killing
import pytest
import stopping_and_continuing
from bench import Laboratory
from tally import Tally

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are watched in Linux's /proc")

Attack = Callable[[Laboratory, int, random.Random], Tally]


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory: pytest.TempPathFactory) -> Laboratory:
    return Laboratory(tmp_path_factory.mktemp("torture"))


def make(attack: Attack, laboratory: Laboratory, times: int) -> Tally:
    """Make an attack, which must hit and find nothing."""
    seed = random.randrange(2**32)
    tally = attack(laboratory, times, random.Random(seed))
    assert not tally.violations, f"drawn from {seed}: {tally}"
    return tally


def test_workers_and_runs_that_are_killed_lose_and_repeat_nothing(laboratory: Laboratory) -> None:
    tally = make(killing.attack, laboratory, 1)
    assert tally.done["batches gone on with"] >= 1


def test_a_process_that_is_stopped_is_waited_for_and_then_taken_over_from(laboratory: Laboratory) -> None:
    assert make(stopping_and_continuing.attack, laboratory, 1).done["batches gone on with"] >= 1


def test_a_disk_that_fills_up_loses_nothing_and_is_said(laboratory: Laboratory) -> None:
    def attack(laboratory: Laboratory, times: int, draw: random.Random) -> Tally:
        return full_disk.attack_mounted(laboratory, times, draw, workers=0)

    tally = make(attack, laboratory, 1)
    if not tally.done["times full"]:
        pytest.skip(tally.notes[0])
    assert tally.done["batches gone on with"] >= 1


def test_where_no_disk_can_be_filled_a_process_may_write_no_longer(laboratory: Laboratory, tmp_path: Path) -> None:
    with suppress(full_disk.NoSmallDiskError), full_disk.small_disk(tmp_path / "disk"):
        pytest.skip("a real disk is filled here")
    assert make(full_disk.attack_limited, laboratory, 1).done["batches gone on with"] >= 1
