"""A process that others took for dead goes on with a batch while another is about to: both come to the same bits.

This happens to a process that was stopped for long, or whose machine has another clock than that of the other.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from climbers import SEEDS, digests, run_climbers
from trial_toys import StoppedError, stopping

from evoclaims.trials.progress import RunProgress
from evoclaims.trials.result import TrialResult
from evoclaims.trials.store import DamagedFileError, Store

pytestmark = pytest.mark.oldest


def between_header_and_state(meanwhile: Callable[[], None]) -> Callable[[RunProgress], None]:
    """Return a watcher that does something once, when the batch is about to be compiled and gone on with."""
    left = [meanwhile]

    def watch(progress: RunProgress) -> None:
        if progress.phase == "resuming" and left:
            left.pop()()

    return watch


def tear(path: Path) -> None:
    path.write_bytes(b"torn")


@pytest.fixture
def interrupted(store: Store, cpus: list[Any]) -> Store:
    """A store with a batch that was stopped early."""
    with pytest.raises(StoppedError):
        run_climbers(store, cpus, stopping(1))
    return store


def test_a_batch_that_moved_on_meanwhile_is_gone_on_with_from_where_it_is(
    interrupted: Store, cpus: list[Any], uninterrupted: list[TrialResult]
) -> None:
    def go_on() -> None:
        with pytest.raises(StoppedError):
            run_climbers(interrupted, cpus, stopping(2))

    results = run_climbers(interrupted, cpus, between_header_and_state(go_on))
    assert digests(results) == digests(uninterrupted)
    assert {result.seed: result.curves for result in results} == {r.seed: r.curves for r in uninterrupted}


def test_a_batch_that_ended_meanwhile_is_no_damage(
    interrupted: Store, cpus: list[Any], uninterrupted: list[TrialResult], puts: Any
) -> None:
    def end() -> None:
        run_climbers(interrupted, cpus)

    assert digests(run_climbers(interrupted, cpus, between_header_and_state(end))) == digests(uninterrupted)
    assert max(puts.values()) == 1
    assert not list(interrupted.checkpoints.iterdir())


def test_a_checkpoint_that_is_gone_takes_its_trials_to_their_beginning(
    interrupted: Store, cpus: list[Any], uninterrupted: list[TrialResult]
) -> None:
    (path,) = interrupted.checkpoints.iterdir()
    assert digests(run_climbers(interrupted, cpus, between_header_and_state(path.unlink))) == digests(uninterrupted)


def test_a_checkpoint_torn_meanwhile_is_named(interrupted: Store, cpus: list[Any]) -> None:
    (path,) = interrupted.checkpoints.iterdir()
    with pytest.raises(DamagedFileError, match=path.name):
        run_climbers(interrupted, cpus, between_header_and_state(lambda: tear(path)))


def test_only_trials_that_nobody_has_stored_meanwhile_are_begun(
    interrupted: Store, cpus: list[Any], uninterrupted: list[TrialResult], puts: Any
) -> None:
    """The seed 6 is in no checkpoint: it is begun after the batch, unless another process has stored it by then."""

    def run_the_other() -> None:
        run_climbers(interrupted, cpus, seeds=[6])

    results = run_climbers(interrupted, cpus, between_header_and_state(run_the_other), seeds=[*SEEDS, 6])
    assert digests(results[:-1]) == digests(uninterrupted)
    assert puts[6] == 1
