"""Environment steps until a curve reaches a value: reached, never, or nobody knows."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import pytest
from hand_made_paper import CONDITIONS
from made_trials import trial_of

from evoclaims.core.errors import UserError
from evoclaims.envs.gates.parity import NParity
from evoclaims.judging.design import Design
from evoclaims.judging.judge import judge
from evoclaims.judging.sample import UnreadableTrialError
from evoclaims.judging.verdict import Outcome
from evoclaims.judging.window import Window
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.methods.training_loop import TrainingLoop
from evoclaims.paper.trial_group import TrialGroup
from evoclaims.trials.imported import Imported
from evoclaims.trials.loop_messages import Trained
from evoclaims.trials.loop_trials import trained_record
from evoclaims.trials.result import TrialResult
from evoclaims.trials.runner import run
from evoclaims.trials.spec import Budget, Condition, TrialSpec
from evoclaims.trials.store import Store

PLAIN = CONDITIONS["better", "small"]
COST = PLAIN.method.cost(PLAIN.task)
LAST = PLAIN.task.levels - 1


def curves_of(success: Sequence[float], levels: Sequence[int] | None = None, chunk: int = 1) -> dict[str, Any]:
    """Return curves with one report after each `chunk` steps."""
    steps = [chunk * (index + 1.0) for index in range(len(success))]
    return {
        "environment_steps": tuple(COST * step for step in steps),
        "success": tuple(success),
        "level": tuple(map(float, levels or [LAST] * len(success))),
    }


def made(condition: Condition, curves: Mapping[str, Any], seed: int = 0, **changes: Any) -> TrialResult:
    return trial_of(condition, seed, 1.0, curves=curves, **changes)


@pytest.fixture
def group() -> Callable[..., TrialGroup]:
    """A function that makes trials with these curves of success, of a condition with a report after each step."""

    def make(*successes: Sequence[float], method: str = "better", generations: int = 4) -> TrialGroup:
        budget = Budget(generations=generations, reports=generations)
        condition = replace(CONDITIONS[method, "small"], budget=budget, progression="whole_budget")

        def get(asked: Condition, seeds: Sequence[int]) -> list[TrialResult]:
            return [made(asked, curves_of(successes[seed]), seed) for seed in seeds]

        return TrialGroup(method, "small", condition, get)

    return make


def read(group: TrialGroup, value: float = 0.9, n: int = 1, **options: Any) -> tuple[float, ...]:
    measure = group.steps_to("success", value, **options)
    return measure.sample({group.fingerprint: tuple(group.fetch(range(n)))}).values


def test_it_is_the_first_report_with_the_value_and_never_is_beyond_the_budget(group: Any) -> None:
    trials = group([0.1, 0.9, 0.2, 1.0], [0.1, 0.2, 0.3, 0.4], [1.0, 0.0, 0.0, 0.0])
    assert read(trials, n=3) == (2 * COST, math.inf, COST)
    measure = trials.steps_to("success", 0.9)
    assert (measure.window, measure.before) == (Window(4.0 * COST, 0.0), None)  # a step of the method is no interval
    assert measure.better == "lower"
    within = f", within {4 * COST:,}"
    assert measure.describe() == f"better on small: environment steps until success is 0.9 on level {LAST}{within}"


def test_a_share_is_reached_whatever_its_rounding_but_a_level_is_solved_at_exactly_1(group: Any) -> None:
    seven_of_ten, nearly = 0.699999988079071, 0.9999999403953552  # in single precision
    trials = group([0.0, seven_of_ten, nearly, 1.0])
    assert (read(trials, 0.7), read(trials, 1.0)) == ((2 * COST,), (4 * COST,))
    trial = trial_of(trials.condition, 0, seven_of_ten)
    assert [trials.last_success_is(value).of(trial) for value in (0.7, 0.70001)] == [1.0, 0.0]
    assert trials.solves_every_level.of(trial_of(trials.condition, 0, nearly)) == 0.0


def test_only_reports_on_the_level_count(group: Any) -> None:
    trials = group([0.0] * 4)
    curves = curves_of([1.0, 1.0, 0.5, 1.0], [0, 0, LAST, LAST])
    trial = made(trials.condition, curves)
    assert trials.steps_to("success", 0.9).of(trial) == 4 * COST
    assert trials.steps_to("success", 0.9, level=0).of(trial) == COST
    assert trials.steps_to("level", LAST).of(trial) == 3 * COST
    with pytest.raises(UserError, match=f"better on small has no level {LAST + 1}. Use one from 0 to {LAST}"):
        trials.steps_to("success", 0.9, level=LAST + 1)


@pytest.mark.parametrize("reports", [4, 2], ids=["a report a step", "a report every two steps"])
def test_of_real_trials_it_is_when_they_solved_the_level(reports: int, tmp_path: Path) -> None:
    """A report has the level that its last step climbed to, with the success on the one that it climbed from."""
    budget = Budget(generations=4, reports=reports)
    condition = Condition(HandBuilt(), NParity(bits=5), "curriculum", budget)
    (trial,) = run(condition, [0], Store(tmp_path), jax.devices("cpu")[:1])
    assert max(trial.curves["level"]) == 3.0
    solved_at = trial.levels["solved_at"]
    assert solved_at == tuple(condition.cost * step for step in (1.0, 2.0, 3.0, 4.0))
    group = TrialGroup("hand_built", "n_parity", condition, lambda *_: [trial])
    measures = [group.steps_to("success", 1.0, level) for level in range(4)]
    assert [measure.of(trial) for measure in measures] == [
        measure.window.seen(solved_at[i]) for i, measure in enumerate(measures)
    ]


def test_between_reports_nothing_is_known() -> None:
    condition = replace(PLAIN, budget=Budget(generations=5, reports=2))  # after three steps, and after five
    trials = TrialGroup("better", "small", condition, lambda *_: [])
    measure = trials.steps_to("success", 0.9)
    assert measure.window == Window(5.0 * COST, 3.0 * COST)
    solved_at_2 = {**curves_of([1.0]), "environment_steps": (2.0 * COST,)}  # a trial that ends once it has solved all
    assert measure.of(made(condition, solved_at_2)) == 3 * COST
    solved_at_4 = {**curves_of([0.0, 1.0]), "environment_steps": (3.0 * COST, 4.0 * COST)}
    assert measure.of(made(condition, solved_at_4)) == 5 * COST


def test_when_a_trial_ends_early_without_the_value_nobody_knows(group: Any) -> None:
    trials = group(*[[0.1, 0.5]] * 5)
    with pytest.raises(
        UnreadableTrialError, match=f"ended after {2 * COST} of {4 * COST} .*progression 'whole_budget'"
    ):
        read(trials)
    verdict = judge(trials.steps_to("success", 0.9) < 4 * COST, Design.fixed(5))
    assert verdict.outcome is Outcome.ERROR


def test_a_misspelt_curve_says_which_there_are(group: Any) -> None:
    trials = group([0.0] * 4)
    with pytest.raises(UnreadableTrialError, match="Did you mean 'success'"):
        trials.steps_to("sucess", 0.9).of(trials.fetch([0])[0])
    with pytest.raises(UserError, match="the value must be a finite number, not nan"):
        trials.steps_to("success", math.nan)
    with pytest.raises(UserError, match="between 0 and 1, and never reaches 90"):
        trials.steps_to("success", 90)


FAST, SLOW, NEVER = [1.0] * 4, [0.0, 0.0, 1.0, 1.0], [0.0] * 4


@pytest.mark.parametrize(
    ("a", "b", "outcome"),
    [
        (FAST, SLOW, Outcome.SUPPORTED),
        (SLOW, NEVER, Outcome.SUPPORTED),
        (NEVER, SLOW, Outcome.REFUTED),
        (NEVER, NEVER, Outcome.INCONCLUSIVE),
    ],
)
def test_sample_efficiency_is_judged(group: Any, a: Any, b: Any, outcome: Outcome) -> None:
    left, right = group(*[a] * 6), group(*[b] * 6, method="worse")
    claim = left.steps_to("success", 0.9) < right.steps_to("success", 0.9)
    verdict = judge(claim, Design.fixed(6))
    assert verdict.outcome is outcome
    if a == b == NEVER:
        what = f"success reaches 0.9 on level {LAST} within {4 * COST:,} environment steps"
        assert verdict.reason == f"in 0 of 6 and 0 of 6 trials {what}: nothing to compare"


def test_budgets_of_two_lengths_are_compared_up_to_the_shorter(group: Any) -> None:
    long = group(*[[0.0, 0.0, 1.0, 1.0]] * 6)
    short = group(*[[0.0, 0.0]] * 6, method="worse", generations=2)
    claim = long.steps_to("success", 0.9) < short.steps_to("success", 0.9)
    verdict = judge(claim, Design.fixed(6))
    assert verdict.outcome is Outcome.INCONCLUSIVE  # within the shorter budget neither has reached it
    assert {sample.limit for sample in verdict.evidence[0].samples} == {2.0 * COST}


SPARSE, DENSE = (20, 40, 60), range(2, 61, 2)


@pytest.mark.parametrize(
    ("ours", "theirs", "ours_at", "theirs_at", "outcome"),
    [
        ((10, 20, 30, 40, 50, 60), (5, 15, 25, 35, 45, 55, 60), 12, 12, Outcome.INCONCLUSIVE),
        ((10, 20, 30, 40, 50, 60), (5, 15, 25, 35, 45, 55, 60), 26, 12, Outcome.SUPPORTED),
        ((10, 20, 30, 40, 50, 60), (5, 15, 25, 35, 45, 55, 60), 99, 12, Outcome.SUPPORTED),
        ((10, 20, 30, 40, 50, 60), (5, 15, 25, 35, 45, 55, 60), 12, 56, Outcome.REFUTED),
        (SPARSE, (3, 23, 43, 60), 22, 22, Outcome.INCONCLUSIVE),
        (SPARSE, SPARSE, 22, 12, Outcome.SUPPORTED),
        ((1, 10, 60), (1, 10, 60), 12, 9, Outcome.SUPPORTED),
        (DENSE, SPARSE, 22, 12, Outcome.SUPPORTED),
        (DENSE, SPARSE, 12, 4, Outcome.INCONCLUSIVE),
    ],
)
def test_where_a_side_reports_does_not_make_it_faster(
    ours: Sequence[int], theirs: Sequence[int], ours_at: int, theirs_at: int, outcome: Outcome, tmp_path: Path
) -> None:
    measures = []
    for name, steps, reached in (("ours", ours, ours_at), ("theirs", theirs, theirs_at)):
        rows = [f"{seed},{at},{9 if at >= reached else 1}" for seed in range(10) for at in steps]
        (tmp_path / f"{name}.csv").write_text("\n".join(["seed,step,return", *rows]))
        condition = Imported(f"{name}.csv", "seed", "return", step="step", folder=tmp_path)
        group = TrialGroup(name, "small", condition, lambda asked, seeds: [asked.existing[seed] for seed in seeds])
        measures.append(group.steps_to("return", 5))
    assert judge(measures[1] < measures[0], Design.fixed(10)).outcome is outcome
    assert judge(2 * measures[1] < 2 * measures[0], Design.fixed(10)).outcome is outcome


@pytest.fixture
def imported(tmp_path: Path) -> Callable[[Sequence[int]], TrialGroup]:
    """A function that imports ten trials with reports at these steps, which are above 5 from the last but one on."""

    def make(steps: Sequence[int]) -> TrialGroup:
        rows = [f"{seed},{at},{9 if at >= steps[-2] else 1}" for seed in range(10) for at in steps]
        (tmp_path / "runs.csv").write_text("\n".join(["seed,step,return", *rows]))
        condition = Imported("runs.csv", "seed", "return", step="step", folder=tmp_path)
        return TrialGroup("theirs", "small", condition, lambda asked, seeds: [asked.existing[seed] for seed in seeds])

    return make


def test_steps_of_an_imported_curve_count_as_reported_however_uneven_its_reports(
    imported: Callable[[Sequence[int]], TrialGroup],
) -> None:
    measure = imported([100, 950, 1000]).steps_to("return", 5)
    assert judge(measure > 960, Design.fixed(10)).outcome is Outcome.REFUTED
    assert judge(measure < 960, Design.fixed(10)).evidence[0].samples[0].median == 950


def test_a_number_between_two_reports_of_an_imported_curve_decides_nothing(
    imported: Callable[[Sequence[int]], TrialGroup],
) -> None:
    """Every trial has reached the value somewhere from 100 to 950."""
    measure = imported([100, 950, 1000]).steps_to("return", 5)
    for claim in (measure > 500, measure < 500, measure.between(600, 1000), measure.between(100, 500)):
        verdict = judge(claim, Design.fixed(10))
        assert (verdict.outcome, verdict.p, verdict.p_refuted) == (Outcome.INCONCLUSIVE, 1.0, 1.0)
        assert "between two reports" in str(verdict.evidence)
    for claim in (measure > 100, measure > 99, measure < 951, measure.between(100, 950)):
        assert judge(claim, Design.fixed(10)).outcome is Outcome.SUPPORTED
    assert judge(measure.between(10, 99), Design.fixed(10)).outcome is Outcome.REFUTED
    assert judge(measure.between(960, 999), Design.fixed(10)).outcome is Outcome.REFUTED


def test_an_imported_trial_that_ended_early_is_not_advised_to_be_run_otherwise(
    imported: Callable[[Sequence[int]], TrialGroup],
) -> None:
    group = imported([100, 950, 1000])
    condition = group.condition
    lines = (condition.folder / condition.path).read_text().splitlines()
    (condition.folder / condition.path).write_text("\n".join(lines[:2] + lines[4:]))  # the first trial ends at 100
    measure = replace(group, condition=replace(condition)).steps_to("return", 5)
    verdict = judge(measure < 960, Design.fixed(10))
    assert verdict.outcome is Outcome.ERROR
    assert "ended after 100 of 1,000 environment steps" in verdict.reason
    assert verdict.reason.endswith(
        "nobody knows when it would have reached that: ask for a value that ended trials have reached"
    )


def test_an_imported_curve_with_an_empty_cell_is_said_to_lack_a_number(
    imported: Callable[[Sequence[int]], TrialGroup],
) -> None:
    group = imported([100, 950, 1000])
    path = group.condition.folder / group.condition.path
    path.write_text(path.read_text().replace("0,100,1\n", "0,100,\n", 1))
    measure = replace(group, condition=replace(group.condition)).steps_to("return", 5)
    verdict = judge(measure < 960, Design.fixed(10))
    assert verdict.outcome is Outcome.ERROR
    assert verdict.reason.startswith("A row of the table has no 'return' for the finished trial of seed 0 (id ")


@pytest.mark.parametrize(("every", "reached"), [(1, 40), (10, 40), (20, 40), (30, None), (40, None)])
def test_a_loop_that_reports_more_seldom_than_its_budget_says_is_no_slower_one(every: int, reached: int | None) -> None:
    budget = Budget(environment_steps=120, reports=12)
    loop = TrainingLoop("its_loops:train", packages=())
    condition = Condition(loop, PLAIN.task, "whole_budget", budget)
    steps = [float(step) for step in range(every, 121, every)]
    fitness, level = [float(step >= 31) for step in steps], [LAST] * len(steps)
    trial = made(condition, {"environment_steps": steps, "fitness": fitness, "level": level})
    trials = TrialGroup("its", "small", condition, lambda asked, seeds: [trial])
    measure = trials.steps_to("fitness", 1)
    if reached is None:
        with pytest.raises(UnreadableTrialError, match=r"reports nothing between \d+ and \d+ environment steps"):
            measure.of(trial)
    else:
        assert measure.of(trial) == reached


@pytest.mark.parametrize(
    ("every", "reached", "outcome"),
    [(7, 5, Outcome.INCONCLUSIVE), (7, 25, Outcome.SUPPORTED), (5, 25, Outcome.SUPPORTED)],
)
def test_a_loop_whose_reports_lie_elsewhere_is_no_slower_one(every: int, reached: int, outcome: Outcome) -> None:
    """Reports of every seventh step, of which one is kept after every ten, are at 14, 21, 35."""
    budget = Budget(environment_steps=120, reports=12)
    groups = []
    for name, each, value in (("ours", 10, 5), ("theirs", every, reached)):
        kept = [min(at for at in range(each, 400, each) if at >= ten) for ten in range(10, 121, 10)]
        condition = Condition(TrainingLoop(f"its_loops:{name}", packages=()), PLAIN.task, "whole_budget", budget)
        curves = {
            "environment_steps": kept,
            "fitness": [float(at >= value) for at in kept],
            "level": [LAST] * len(kept),
        }
        trials = [made(condition, curves, seed, digest="") for seed in range(10)]
        groups.append(TrialGroup(name, "small", condition, lambda asked, seeds, mine=tuple(trials): mine[: len(seeds)]))
    ours, theirs = (group.steps_to("fitness", 1) for group in groups)
    assert judge(ours < theirs, Design.fixed(10)).outcome is outcome


def test_a_number_between_two_reports_of_a_loop_decides_nothing() -> None:
    """Reports of every seventh step are at 14, 21, 28 …: the value is reached from 22 to 28."""
    condition = Condition(
        TrainingLoop("its_loops:train", packages=()),
        PLAIN.task,
        "whole_budget",
        Budget(environment_steps=120, reports=12),
    )
    kept = [min(at for at in range(7, 400, 7) if at >= ten) for ten in range(10, 121, 10)]
    curves = {"environment_steps": kept, "fitness": [float(at >= 28) for at in kept], "level": [LAST] * len(kept)}
    trials = [made(condition, curves, seed, digest="") for seed in range(10)]
    measure = TrialGroup("its", "small", condition, lambda asked, seeds: trials[: len(seeds)]).steps_to("fitness", 1)
    verdict = judge(measure > 30, Design.fixed(10))
    assert (measure.of(trials[0]), verdict.outcome, verdict.p) == (40, Outcome.INCONCLUSIVE, 1.0)
    assert judge(measure > 20, Design.fixed(10)).outcome is Outcome.SUPPORTED
    assert judge(measure < 50, Design.fixed(10)).outcome is Outcome.SUPPORTED


def test_generations_of_a_training_loop_are_no_environment_steps(group: Any) -> None:
    loop = TrainingLoop("its_loops:train", packages=())
    condition = replace(PLAIN, method=loop, budget=Budget(generations=4, reports=4), progression="whole_budget")
    its, ours = TrialGroup("its", "small", condition, lambda *_: []), group(FAST)
    curves = {"environment_steps": (1.0, 2.0, 4.0), "success": (0.0, 1.0, 1.0), "level": (float(LAST),) * 3}

    def made_by_it(**returned: float) -> TrialResult:
        trained = Trained({"last_success": 1.0, **returned}, None, 4)
        return trained_record(TrialSpec(condition, 0), loop, trained, curves, {}, jax.devices()[:1])

    measure = its.steps_to("success", 1.0)
    assert measure.describe() == f"its on small: generations until success is 1 on level {LAST}, within 4"
    assert measure.of(made_by_it()) == 2
    with pytest.raises(UnreadableTrialError, match=r"\(in environment steps\).* \(in generations\) are not"):
        (ours.steps_to("success", 1.0) > measure).below.of(made_by_it())
    for steps in (its.environment_steps, its.measure("environment_steps", better="lower")):
        with pytest.raises(UnreadableTrialError, match="its_loops:train has a budget in generations, and returned no"):
            steps.of(made_by_it())
        assert steps.of(made_by_it(environment_steps=800)) == 800
    assert its.measure("steps").of(made_by_it()) == its.measure("steps").of(made_by_it(environment_steps=800)) == 4
