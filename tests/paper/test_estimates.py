"""About how long missing trials take: by trials of the same condition, of its names, or by the budget."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest
from hand_made_paper import CONDITIONS
from made_trials import trial_of

from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.paper import references
from evoclaims.paper.estimates import COMPILE_SECONDS, Missing, committed, estimates
from evoclaims.paper.reproduction import Reproduction
from evoclaims.paper.variant import Variant
from evoclaims.trials.budget import Budget
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Condition

CONDITION = Condition(HandBuilt(), NParity(2), "curriculum", Budget(generations=100))
LONGER = replace(CONDITION, budget=Budget(generations=400))


def _trials(
    run: float,
    platform: str = "cpu",
    condition: Condition = CONDITION,
    count: int = 4,
    started: str = "monday",
    cores: float | None = 1,
) -> list[TrialResult]:
    """Return a batch of trials that spent half of the budget."""
    timing = {"run": run, "compile": 2.0, "batch": count, "started": started}
    timing |= {"processor": run * cores} if platform == "cpu" and cores else {}
    return [
        trial_of(
            condition,
            seed,
            1.0,
            metrics={"environment_steps": condition.environment_steps / 2},
            timing=timing,
            provenance={"device": {"platform": platform, "kind": platform, "count": 1}},
        )
        for seed in range(count)
    ]


def _seconds(platform: str, *cases: tuple[Condition, int, Sequence[TrialResult]], cores: int = 1) -> list[float]:
    found = estimates({number: Missing(*case) for number, case in enumerate(cases)}, platform)
    return [found[number].seconds(cores) for number in range(len(cases))]


def test_trials_of_the_same_condition_take_as_long_as_they_took() -> None:
    assert _seconds("cpu", (CONDITION, 8, _trials(20.0))) == [2.0 + 40.0]
    assert _seconds("gpu", (CONDITION, 8, _trials(20.0, "gpu"))) == [2.0 + 20.0]  # side by side


def test_of_several_batches_the_largest_counts() -> None:
    few = _trials(1000.0, count=1, started="tuesday")
    assert _seconds("cpu", (CONDITION, 4, [*few, *_trials(20.0)])) == [22.0]


def test_another_condition_of_the_same_names_counts_by_its_pace() -> None:
    assert _seconds("cpu", (LONGER, 4, _trials(20.0))) == [2.0 + 4 * 2 * 20.0]  # four budgets, and each to its end
    assert _seconds("gpu", (LONGER, 4, _trials(20.0, "gpu"))) == [2.0 + 4 * 2 * 20.0]


def test_trials_that_ran_side_by_side_took_the_time_of_so_many_cores() -> None:
    batch = _trials(20.0, cores=2)
    assert _seconds("cpu", (CONDITION, 8, batch)) == [2.0 + 80.0]
    assert _seconds("cpu", (CONDITION, 8, batch), cores=2) == [2.0 + 40.0]


def test_where_a_record_tells_no_cores_it_had_as_many_as_are_here(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("evoclaims.paper.estimates.usable_cores", lambda: 2)
    assert _seconds("cpu", (CONDITION, 8, _trials(20.0, cores=None)), cores=2) == [2.0 + 40.0]


def test_a_trial_that_is_both_stored_and_committed_ran_once() -> None:
    batch = _trials(20.0)
    assert _seconds("cpu", (CONDITION, 8, [*batch, *batch])) == _seconds("cpu", (CONDITION, 8, batch))
    longer = _seconds("cpu", (LONGER, 4, batch))
    assert _seconds("cpu", (LONGER, 4, [*batch, *batch])) == longer


def test_the_protocols_trials_come_first_and_a_variants_own_tell_of_the_variant(reproduction: Reproduction) -> None:
    names = "better", "small"
    variants = {"slow": Variant("It is slow", {"full": {names: LONGER}})}
    reproduction = replace(reproduction, variants=variants)
    for variant, tier, run in (("", "smoke", 20.0), ("", "full", 40.0), ("slow", "full", 1000.0)):
        path = references.path_of(reproduction.references_of(variant), tier, *names)
        condition = reproduction.tier(tier, variant).condition(*names)
        references.write(path, _trials(run, condition=condition, started=f"{variant} {tier}"))
    found = committed(reproduction, "full", *names)
    assert [trial.timing["run"] for trial in found[::4]] == [40.0, 20.0, 1000.0]
    assert _seconds("cpu", (LONGER, 4, found), (CONDITIONS[names], 4, found)) == [1002.0, 42.0]


def test_what_has_not_run_on_such_a_device_counts_by_its_budget_at_the_pace_of_the_others() -> None:
    elsewhere = _trials(1.0, "gpu")
    known, unknown, longer = _seconds(
        "cpu", (CONDITION, 4, _trials(20.0)), (CONDITION, 4, elsewhere), (LONGER, 4, elsewhere)
    )
    assert unknown == known
    assert longer == 2.0 + 4 * 20.0


def test_where_nothing_has_run_longer_budgets_come_out_longer() -> None:
    short, long = _seconds("cpu", (CONDITION, 4, []), (LONGER, 4, []))
    assert COMPILE_SECONDS < short < long


@pytest.mark.parametrize(("cores", "seconds"), [(1, 42.0), (2, 22.0), (8, 7.0), (64, 7.0)])
def test_a_batch_uses_no_more_cores_than_it_has_trials(cores: int, seconds: float) -> None:
    assert _seconds("cpu", (CONDITION, 8, _trials(20.0)), cores=cores) == [seconds]
    assert _seconds("gpu", (CONDITION, 8, _trials(20.0, "gpu")), cores=cores) == [22.0]
