"""A batch that the device's memory does not hold goes on in halves, from where it was, to the same bits."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import jax
import pytest
from climbers import SEEDS, Log, digests, run_climbers

from evoclaims.trials import checkpoint
from evoclaims.trials.lanes import Lanes
from evoclaims.trials.layout import Layout
from evoclaims.trials.result import TrialResult
from evoclaims.trials.store import Store

pytestmark = pytest.mark.oldest

Small = Callable[..., None]


@pytest.fixture
def small_memory(monkeypatch: pytest.MonkeyPatch) -> Small:
    """A function that plants a memory in which one function of the lanes has room for a few of them."""

    def plant(name: str, lanes: int, from_step: int = 0) -> None:
        function = getattr(Lanes, name)

        def exhausted(self: Lanes, state: Any, *rest: Any) -> Any:
            held = sum(len(share.seed) for share in state)
            if held > lanes and max(int(max(share.steps)) for share in state) >= from_step:
                raise jax.errors.JaxRuntimeError("RESOURCE_EXHAUSTED: Out of memory while trying to allocate 9 bytes.")
            return function(self, state, *rest)

        monkeypatch.setattr(Lanes, name, exhausted)

    return plant


@pytest.mark.parametrize(
    ("name", "lanes", "from_step", "told"),
    [
        ("advance", 3, 0, ["5 trials at once: on with 3"]),
        (
            "advance",
            1,
            0,
            ["5 trials at once: on with 3", "3 trials at once: on with 2", "2 trials at once: on with 1"],
        ),
        ("advance", 3, 2, ["trials at once: on with"]),
        ("examine", 2, 0, ["trials at once: on with"]),
    ],
)
def test_trials_are_the_same_to_the_bit_whatever_fits_into_memory(
    name: str,
    lanes: int,
    from_step: int,
    told: list[str],
    store: Store,
    cpus: list[Any],
    uninterrupted: list[TrialResult],
    small_memory: Small,
    puts: Counter[int],
) -> None:
    small_memory(name, lanes, from_step)
    log = Log()
    assert digests(run_climbers(store, cpus, log)) == digests(uninterrupted)
    assert puts == Counter(SEEDS)
    said = [phase for phase in log.phases() if "memory" in phase]
    assert len(said) >= len(told)
    assert all(text in phase for text, phase in zip(told, said, strict=False))
    assert not list(store.checkpoints.glob("*"))


def test_halves_go_on_from_the_last_checkpoint(store: Store, cpus: list[Any], small_memory: Small) -> None:
    small_memory("advance", 3, from_step=4)
    log = Log()
    results = run_climbers(store, cpus, log)
    halves = Counter(result.timing["started"] for result in results)
    assert sorted(halves.values()) == [2, 3]  # batches of their own, so that their times add up
    phases = [progress.phase for progress in log]
    split = next(place for place, phase in enumerate(phases) if "memory" in phase)
    assert "training" in phases[:split]
    assert phases[split + 1] == "resuming"
    assert min(progress.steps for progress in log[split + 1 :] if progress.phase == "training") > 4


def test_trials_side_by_side_on_several_devices_are_all_run_once(
    store: Store, cpus: list[Any], small_memory: Small, puts: Counter[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Their bits may depend on the number of lanes, so that only the trials are compared."""
    monkeypatch.setattr("evoclaims.trials.lanes.layout_on", lambda platform: Layout.VECTOR)
    small_memory("advance", 4, from_step=2)
    results = run_climbers(store, cpus)
    assert [result.seed for result in results] == list(SEEDS)
    assert puts == Counter(SEEDS)
    assert not list(store.checkpoints.glob("*"))


def test_a_kill_between_the_halves_and_the_removal_of_the_whole_loses_and_repeats_nothing(
    store: Store,
    cpus: list[Any],
    uninterrupted: list[TrialResult],
    small_memory: Small,
    puts: Counter[int],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class KilledError(Exception):
        pass

    def killed(*arguments: Any) -> None:
        raise KilledError

    remove = checkpoint.remove
    small_memory("advance", 3, from_step=2)
    monkeypatch.setattr("evoclaims.trials.checkpoint.remove", killed)
    with pytest.raises(KilledError):
        run_climbers(store, cpus)
    assert len(list(store.checkpoints.glob("*"))) == 3
    monkeypatch.setattr("evoclaims.trials.checkpoint.remove", remove)
    assert digests(run_climbers(store, cpus)) == digests(uninterrupted)
    assert puts == Counter(SEEDS)
    assert not list(store.checkpoints.glob("*"))
