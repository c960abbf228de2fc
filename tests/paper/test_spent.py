"""What reference trials have cost: per batch, on the accelerator that they were made on, and per core of a CPU."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import pytest
from hand_made_paper import CONDITIONS

from evoclaims.paper import references
from evoclaims.paper.reproduction import Reproduction
from evoclaims.paper.spent import spent
from evoclaims.paper.variant import Variant
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Condition

BETTER = CONDITIONS["better", "small"]
GPU = {"platform": "gpu", "kind": "NVIDIA H200", "count": 1}
CPU = {"platform": "cpu", "kind": "cpu", "count": 1}


@pytest.fixture
def batch(made: Callable[..., TrialResult]) -> Callable[..., list[TrialResult]]:
    """A function that makes trials of one batch, which ran for 60 seconds after compiling for 3."""

    def make(
        seeds: Sequence[int],
        device: dict[str, Any],
        started: str = "now",
        condition: Condition = BETTER,
        processor: float | None = 120.0,
    ) -> list[TrialResult]:
        timing = {"run": 60.0, "compile": 3.0, "batch": len(seeds), "started": started}
        timing |= {"processor": processor} if device is CPU and processor is not None else {}
        return [replace(made(condition, seed, 1.0, device=device), timing=timing) for seed in seeds]

    return make


def _commit(reproduction: Reproduction, tier: str, trials: list[TrialResult]) -> None:
    references.write(references.path_of(reproduction.references, tier, "better", "small"), trials)


def test_a_batch_is_paid_once_and_batches_add_up(reproduction: Reproduction, batch: Any) -> None:
    _commit(reproduction, "full", [*batch(range(5), GPU), *batch(range(5, 10), GPU, "later")])
    found = spent(reproduction, "full", "better", "small")
    assert (found.trials, found.seconds, found.core_pace) == (10, {"NVIDIA H200": 126.0}, None)
    assert found.core_seconds(1_000) is None


def test_a_core_s_pace_is_the_tier_s_own_or_another_s(reproduction: Reproduction, batch: Any) -> None:
    """Records have 100 environment steps and their seed: seeds 0 and 1 took 120 s of cores for 201 steps."""
    _commit(reproduction, "smoke", batch(range(2), CPU))
    found = spent(reproduction, "full", "better", "small")
    assert (found.trials, found.seconds) == (0, {})
    assert found.core_seconds(201) == pytest.approx(120.0)
    _commit(reproduction, "full", batch(range(1), CPU, processor=60.0))
    assert spent(reproduction, "full", "better", "small").core_seconds(100) == pytest.approx(60.0)


def test_a_variant_s_trials_are_its_own_and_its_pace_is_the_protocol_s_where_it_has_none(
    reproduction: Reproduction, batch: Any
) -> None:
    worse = Variant("The better is worse.", {"full": {("better", "small"): CONDITIONS["worse", "small"]}})
    reproduction = replace(reproduction, variants={"worse": worse})
    _commit(reproduction, "full", [*batch(range(5), GPU), *batch(range(5, 7), CPU, "later")])
    found = spent(reproduction, "full", "better", "small", "worse")
    assert (found.trials, found.seconds) == (0, {})
    assert found.core_seconds(211) == pytest.approx(120.0)
    path = references.path_of(reproduction.references_of("worse"), "full", "better", "small")
    references.write(path, batch(range(5), GPU, condition=CONDITIONS["worse", "small"]))
    found = spent(reproduction, "full", "better", "small", "worse")
    assert (found.trials, found.seconds) == (5, {"NVIDIA H200": 63.0})
    assert spent(reproduction, "full", "better", "small").trials == 7
    alike = replace(reproduction, variants={"worse": worse, "alike": worse})
    assert spent(alike, "full", "better", "small", "alike") == found  # committed under the other's name


def test_a_core_s_pace_is_not_known_where_no_record_tells_what_several_trials_took_of_it(
    reproduction: Reproduction, batch: Any
) -> None:
    _commit(reproduction, "full", batch(range(2), CPU, processor=None))
    assert spent(reproduction, "full", "better", "small").core_pace is None
    _commit(reproduction, "smoke", batch(range(2), CPU))
    assert spent(reproduction, "full", "better", "small").core_seconds(201) == pytest.approx(120.0)
    _commit(reproduction, "full", batch(range(1), CPU, processor=None))  # a trial alone has one
    assert spent(reproduction, "full", "better", "small").core_seconds(100) == pytest.approx(60.0)


def test_trials_of_another_condition_or_without_an_end_count_for_nothing(
    reproduction: Reproduction, batch: Any
) -> None:
    stale = batch(range(2), GPU, condition=CONDITIONS["better", "large"])
    crashed = [replace(trial, status="timeout") for trial in batch(range(2, 4), GPU)]
    _commit(reproduction, "full", [*stale, *crashed])
    found = spent(reproduction, "full", "better", "small")
    assert (found.trials, found.seconds) == (2, {})
    assert spent(reproduction, "full", "worse", "small").trials == 0
