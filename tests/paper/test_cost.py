"""What trials cost: missing ones by trials of the same condition, of its names, or by the budget; committed ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from hand_made_paper import CONDITIONS
from made_trials import trial_of

from evoclaims.envs.gates.parity import NParity
from evoclaims.judging.design import Design
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.paper import references
from evoclaims.paper.cost import COMPILE_SECONDS, Estimator, Owed, Wanted, of_names, took
from evoclaims.paper.reproduction import Reproduction, Tier, Variant
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Budget, Condition
from evoclaims.trials.store import Store

CONDITION = Condition(HandBuilt(), NParity(2), "curriculum", Budget(generations=100))
LONGER = replace(CONDITION, budget=Budget(generations=400))


def _trials(
    run: float,
    platform: str = "cpu",
    condition: Condition = CONDITION,
    count: int = 4,
    started: str = "monday",
    cores: float | None = 1,
    machine: str | None = None,
) -> list[TrialResult]:
    """Return a batch of trials that spent half of the budget, made here unless a machine is named."""
    timing = {"run": run, "compile": 2.0, "batch": count, "started": started}
    timing |= {"processor": run * cores} if platform == "cpu" and cores else {}
    where = {} if machine is None else {"machine": machine}
    return [
        trial_of(
            condition,
            seed,
            1.0,
            metrics={"environment_steps": condition.environment_steps / 2},
            timing=timing,
            provenance={"device": {"platform": platform, "kind": platform.upper(), "count": 1}} | where,
        )
        for seed in range(count)
    ]


Case = tuple[Condition, int, Sequence[TrialResult]]
"""A condition, how many trials of it are asked for, and the committed trials of its names."""


@pytest.fixture
def owed(tmp_path: Path) -> Callable[..., list[Owed]]:
    """A function that estimates cases on a platform."""

    def estimate(platform: str, *cases: Case, kind: str = "") -> list[Owed]:
        wanted = {
            number: Wanted(("m", str(number)), condition, range(n)) for number, (condition, n, _) in enumerate(cases)
        }
        tier = Tier({one.names: one.condition for one in wanted.values()}, Design.fixed(10))
        paper = Reproduction("tiny", "A Tiny Paper", tmp_path, {"full": tier})
        for number, (_, _, trials) in enumerate(cases):
            references.write(references.path_of(paper.references, "full", *wanted[number].names), trials)
        found = Estimator(Store(tmp_path / "store"), paper, "full", platform, kind).owed(wanted)
        return [found[number] for number in range(len(cases))]

    return estimate


@pytest.fixture
def seconds_of(owed: Callable[..., list[Owed]]) -> Callable[..., list[float]]:
    """A function that estimates the seconds of cases on a platform."""

    def estimate(platform: str, *cases: Case, cores: int = 1) -> list[float]:
        return [one.cost.seconds(cores) for one in owed(platform, *cases)]

    return estimate


Seconds = Callable[..., list[float]]


def test_trials_of_the_same_condition_take_as_long_as_they_took(seconds_of: Seconds) -> None:
    assert seconds_of("cpu", (CONDITION, 8, _trials(20.0))) == [2.0 + 40.0]
    assert seconds_of("gpu", (CONDITION, 8, _trials(20.0, "gpu"))) == [2.0 + 20.0]  # side by side


def test_of_several_batches_the_largest_counts(seconds_of: Seconds) -> None:
    few = _trials(1000.0, count=1, started="tuesday")
    assert seconds_of("cpu", (CONDITION, 4, [*few, *_trials(20.0)])) == [22.0]


def test_another_condition_of_the_same_names_counts_by_its_pace(seconds_of: Seconds) -> None:
    assert seconds_of("cpu", (LONGER, 4, _trials(20.0))) == [2.0 + 4 * 2 * 20.0]  # four budgets, and each to its end
    assert seconds_of("gpu", (LONGER, 4, _trials(20.0, "gpu"))) == [2.0 + 4 * 2 * 20.0]


def test_trials_that_ran_side_by_side_took_the_time_of_so_many_cores(seconds_of: Seconds) -> None:
    batch = _trials(20.0, cores=2)
    assert seconds_of("cpu", (CONDITION, 8, batch)) == [2.0 + 80.0]
    assert seconds_of("cpu", (CONDITION, 8, batch), cores=2) == [2.0 + 40.0]


def test_where_a_record_tells_no_cores_it_had_as_many_as_are_here(
    seconds_of: Seconds, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("evoclaims.paper.cost.usable_cores", lambda: 2)
    assert seconds_of("cpu", (CONDITION, 8, _trials(20.0, cores=None)), cores=2) == [2.0 + 40.0]


def test_a_trial_that_is_given_twice_ran_once(seconds_of: Seconds) -> None:
    batch = _trials(20.0)
    for condition in (CONDITION, LONGER):
        once, twice = seconds_of("cpu", (condition, 4, batch)), seconds_of("cpu", (condition, 4, [*batch, *batch]))
        assert once == twice


def test_the_protocols_trials_come_first_and_a_variants_own_say_what_the_variant_costs(
    reproduction: Reproduction, store: Store
) -> None:
    names = "better", "small"
    variants = {"slow": Variant("It is slow", {"full": {names: LONGER}})}
    reproduction = replace(reproduction, variants=variants)
    for variant, tier, run in (("", "smoke", 20.0), ("", "full", 40.0), ("slow", "full", 1000.0)):
        path = references.path_of(reproduction.references_of(variant), tier, *names)
        condition = reproduction.tier(tier, variant).condition(*names)
        references.write(path, _trials(run, condition=condition, started=f"{variant} {tier}"))
    found = of_names(reproduction, ("full", "smoke"), *names)
    assert [trial.timing["run"] for trial in found[::4]] == [40.0, 20.0, 1000.0]
    estimator = Estimator(store, reproduction, "full", "cpu")
    both = {name: Wanted(names, one, range(4)) for name, one in (("slow", LONGER), ("", CONDITIONS[names]))}
    assert {name: one.cost.seconds() for name, one in estimator.owed(both).items()} == {"slow": 1002.0, "": 42.0}


def test_what_is_stored_is_not_owed_and_counts_before_what_is_committed(
    reproduction: Reproduction, store: Store
) -> None:
    names = "better", "small"
    references.write(references.path_of(reproduction.references, "full", *names), _trials(1.0, condition=LONGER))
    for trial in _trials(20.0, count=2, condition=CONDITIONS[names]):
        assert store.put(trial, {}) == "stored"
    wanted = {"": Wanted(names, CONDITIONS[names], range(10))}
    estimator = Estimator(store, reproduction, "full", "cpu", any_version=True)
    assert estimator.owed(wanted)[""] == Owed(tuple(range(2, 10)), replace(estimator.owed(wanted)[""].cost, work=80.0))
    assert Estimator(store, reproduction, "full", "cpu").owed(wanted)[""].seeds == tuple(range(10))  # other versions


def test_other_machines_count_by_how_much_longer_conditions_take_here(
    owed: Callable[..., list[Owed]], store: Store
) -> None:
    there = _trials(10.0, machine="a fast one", started="sunday")
    (one,) = owed("cpu", (CONDITION, 4, there))
    assert (one.cost.basis, one.cost.seconds()) == ("elsewhere", 12.0)
    longer = _trials(100.0, machine="a fast one", condition=LONGER)
    for trial in _trials(34.0):  # the same trials, run again here
        store.put(trial, {})
    here, one = owed("cpu", (CONDITION, 4, there), (LONGER, 4, longer))
    assert (here.cost.basis, here.cost.seconds()) == ("here", 36.0)
    assert (one.cost.basis, one.cost.seconds()) == ("here", pytest.approx(3 * 102.0))


def test_only_trials_of_a_kind_of_device_count_where_one_is_named(owed: Callable[..., list[Owed]]) -> None:
    case = CONDITION, 4, _trials(20.0, "gpu")
    (named,), (other,) = owed("gpu", case, kind="GPU"), owed("gpu", case, kind="NVIDIA Abacus")
    assert (named.cost.basis, other.cost.basis) == ("here", "budget")


def test_a_file_of_committed_trials_that_cannot_be_read_says_nothing(reproduction: Reproduction, store: Store) -> None:
    path = references.path_of(reproduction.references, "full", "better", "small")
    path.parent.mkdir(parents=True)
    path.write_text("no record")
    found = Estimator(store, reproduction, "full", "cpu").owed({"": Wanted(("better", "small"), CONDITION, range(4))})
    assert found[""].cost.basis == "budget"


def test_what_has_not_run_on_such_a_device_counts_by_its_budget_at_the_pace_of_the_others(seconds_of: Seconds) -> None:
    elsewhere = _trials(1.0, "gpu")
    known, unknown, longer = seconds_of(
        "cpu", (CONDITION, 4, _trials(20.0)), (CONDITION, 4, elsewhere), (LONGER, 4, elsewhere)
    )
    assert unknown == known
    assert longer == 2.0 + 4 * 20.0


def test_what_has_not_run_counts_at_the_pace_of_its_own_method(tmp_path: Path, store: Store) -> None:
    wanted, longer = {}, replace(CONDITION, task=NParity(3))
    paper = Reproduction("tiny", "A Tiny Paper", tmp_path, {"full": Tier({}, Design.fixed(10))})
    for method, run in (("slow", 1000.0), ("quick", 1.0), ("quicker", 0.5)):
        references.write(references.path_of(paper.references, "full", method, "2"), _trials(run))
        wanted |= {(method, "2"): CONDITION, (method, "3"): longer}
    asked = {names: Wanted(names, condition, range(4)) for names, condition in wanted.items()}
    found = {names: one.cost for names, one in Estimator(store, paper, "full", "cpu").owed(asked).items()}
    assert found["slow", "3"].basis == "budget"
    share = longer.environment_steps / CONDITION.environment_steps
    for method in ("slow", "quick", "quicker"):
        assert found[method, "3"].work == pytest.approx(share * found[method, "2"].work)


def test_where_nothing_has_run_longer_budgets_come_out_longer(seconds_of: Seconds) -> None:
    short, long = seconds_of("cpu", (CONDITION, 4, []), (LONGER, 4, []))
    assert COMPILE_SECONDS < short < long


@pytest.mark.parametrize(("cores", "seconds"), [(1, 42.0), (2, 22.0), (8, 7.0), (64, 7.0)])
def test_a_batch_uses_no_more_cores_than_it_has_trials(seconds_of: Seconds, cores: int, seconds: float) -> None:
    assert seconds_of("cpu", (CONDITION, 8, _trials(20.0)), cores=cores) == [seconds]
    assert seconds_of("gpu", (CONDITION, 8, _trials(20.0, "gpu")), cores=cores) == [22.0]


def test_a_batch_on_an_accelerator_is_paid_once_and_batches_add_up() -> None:
    trials = [*_trials(60.0, "gpu"), *_trials(90.0, "gpu", started="tuesday"), *_trials(7.0, started="friday")]
    assert took(trials) == {"GPU": 154.0}
    assert took([replace(trial, status="timeout") for trial in trials]) == {}
