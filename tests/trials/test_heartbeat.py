"""Something done again and again beside a computation, and no longer than it lasts."""

from __future__ import annotations

import threading

import pytest

from evoclaims.trials.heartbeat import beating


def test_it_beats_again_and_again_until_the_block_ends() -> None:
    beats = threading.Semaphore(0)
    with beating(beats.release, 0.001):
        assert all(beats.acquire(timeout=60) for _ in range(3))
        (thread,) = [thread for thread in threading.enumerate() if thread.name == "evoclaims heartbeat"]
        assert thread.daemon
    assert not thread.is_alive()


def test_it_ends_when_the_block_fails() -> None:
    with pytest.raises(ZeroDivisionError), beating(lambda: None, 60.0):
        raise ZeroDivisionError
    assert "evoclaims heartbeat" not in [thread.name for thread in threading.enumerate()]
