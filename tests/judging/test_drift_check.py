"""Drift: new trials against at least ten references of the same condition, corrected over the suite."""

from __future__ import annotations

import itertools
import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evoclaims.judging import joint_test
from evoclaims.judging.drift import MOST, DriftCase, changed_settings, check_drift, measured

BEFORE = [0.50, 0.52, 0.54, 0.56, 0.58, 0.60, 0.62, 0.64, 0.66, 0.68]


@pytest.fixture
def case(trial):
    """Return the factory of cases of the condition "c"; references take the seeds from 100."""

    def make(new, reference=BEFORE, of="c", metrics=("score",), label="ppo on n_parity", method=""):  # type: ignore[no-untyped-def]
        return DriftCase(
            label,
            "c",
            tuple(trial(seed, value, "c") for seed, value in enumerate(new)),
            tuple(trial(100 + seed, value, of) for seed, value in enumerate(reference)),
            metrics,
            method=method,
        )

    return make


def turned(values: list[float], by: int) -> list[float]:
    """Return values of other seeds, so that conditions do not repeat each other."""
    return [values[(at + by) % len(values)] for at in range(len(values))]


@pytest.mark.parametrize("level", [0.1, 0.9])
def test_a_shift_in_either_direction_is_drift(case, level: float) -> None:
    report = check_drift([case([level] * 5)])
    assert report.rows[0].p == pytest.approx(2 / math.comb(15, 5))
    assert report.rows[0].drifted
    assert report.drifted


@pytest.mark.parametrize(("metric", "a12"), [("score", 0.0), ("environment_steps", 1.0)])
def test_a_trial_that_failed_counts_as_the_worst(case, metric: str, a12: float) -> None:
    """Fewer steps are better, so that a failed trial has taken more than any other."""
    found = case(["diverged"] * 5, metrics=(metric,))
    earlier = tuple(replace(one, metrics={**one.metrics, "environment_steps": 100.0}) for one in found.reference)
    (row,) = check_drift([replace(found, reference=earlier)]).rows
    assert (row.a12, row.drifted) == (a12, True)


def test_the_suite_pays_holms_correction_over_methods(case) -> None:
    def suite(others: int):  # type: ignore[no-untyped-def]
        steady = [case([0.51, 0.55, 0.59, 0.63, 0.67], method=f"m{n}") for n in range(others)]
        return check_drift([case([0.9] * 5), *steady])

    few, many = suite(4), suite(15)
    assert few.rows[0].p_holm == pytest.approx(5 * 2 / math.comb(15, 5))
    assert [row.drifted for row in few.rows] == [True, False, False, False, False]
    assert few.drifted
    assert not many.drifted
    assert {row.status for row in many.rows} == {"underpowered"}


def test_what_cannot_have_changed_costs_nothing(case, trial) -> None:
    """Trials that are their references to the bit are not tested, and neither are other groups."""
    same = tuple(trial(seed, value, "c", digest=str(seed)) for seed, value in enumerate(BEFORE))
    equal = [DriftCase(f"{n} on t", "c", same[:5], same, ("score",), method=str(n)) for n in range(20)]
    steady = [replace(case([0.51, 0.55, 0.59, 0.63, 0.67], method=f"m{n}"), group="jax 1 -> 2") for n in range(20)]
    report = check_drift([case([0.9] * 5), *equal, *steady])
    assert report.rows[0].p_holm == report.rows[0].p == pytest.approx(2 / math.comb(15, 5))
    assert {row.status for row in report.rows[1:21]} == {"no drift"}
    assert {row.detail for row in report.rows[1:21]} == {"the same trials to the bit"}


def test_a_method_is_tested_by_all_its_conditions_together(case) -> None:
    """No condition alone shows what five of them show together; it is named where it shows most."""
    up = [0.56, 0.60, 0.64, 0.68, 0.70, 0.72]
    cases = [case(turned(up, n), turned(BEFORE, 3 * n), label=f"ppo on {n}", method="ppo") for n in range(5)]
    others = [case(BEFORE[::2], label=f"m{n} on t", method=f"m{n}") for n in range(5)]
    together = check_drift([*cases, *others])
    assert [row.label for row in together.rows if row.drifted] == ["ppo on 0"]
    alone = check_drift([replace(one, method=one.label) for one in cases] + others)
    assert not alone.drifted
    assert alone.nearest is not None
    assert "no drift shown; nearest: ppo on" in alone.undecided
    assert together.detectable["ppo"] < min(shift for name, shift in together.detectable.items() if name != "ppo")


def test_where_a_drift_shows_is_asked_at_the_level_at_which_it_was_found(case) -> None:
    """Both conditions have moved by what is found at 0.1, and at 0.01 would not be."""
    up = [0.56, 0.60, 0.64, 0.68, 0.70, 0.72]
    found = check_drift([case(up, label=f"ppo on {n}", method="ppo") for n in range(2)], alpha=0.2)
    assert [row.drifted for row in found.rows] == [True, True]


def test_conditions_that_repeat_each_other_count_once(case) -> None:
    """They share seeds, and may share random numbers: so what one seed does in each of five is no news."""
    new = [0.59, 0.61, 0.63, 0.65, 0.67]
    alone = check_drift([case(new, method="ppo")])
    five = check_drift([case(new, label=f"ppo on {n}", method="ppo") for n in range(5)])
    assert five.rows[0].p_holm == pytest.approx(alone.rows[0].p_holm, rel=0.3)
    assert five.detectable == pytest.approx(alone.detectable)


def test_the_joint_p_is_that_of_all_permutations(case) -> None:
    """Two measures of one condition, whose 3,003 splits are few enough to list."""
    rng = np.random.default_rng(7)
    new, old = rng.normal(0.7, 1, size=(5, 2)), rng.normal(size=(10, 2))
    one = case([0.0] * 5)
    sides = [
        tuple(replace(t, metrics={"a": x, "b": y}) for t, (x, y) in zip(trials, values.tolist(), strict=True))
        for trials, values in ((one.new, new), (one.reference, old))
    ]
    found = check_drift([replace(one, new=sides[0], reference=sides[1], metrics=("a", "b"))]).rows[0].p_holm
    ranks = np.apply_along_axis(lambda column: column.argsort().argsort() - 7.0, 0, np.concatenate([new, old]))
    z = np.array([ranks[list(chosen)].sum(axis=0) for chosen in itertools.combinations(range(15), 5)])
    statistics = [np.abs(z.sum(axis=1)), (z**2).sum(axis=1), np.abs(z).max(axis=1)]
    above = np.array([[np.mean(s >= x - 1e-9) for x in s] for s in statistics]).min(axis=0)
    assert found == pytest.approx(np.mean(above <= above[0]), abs=0.03)


def test_a_condition_with_more_trials_counts_for_more(case, monkeypatch: pytest.MonkeyPatch) -> None:
    """One has moved, with many trials on both sides; eight with few trials have not, and add almost no noise."""
    rng = np.random.default_rng(3)
    moved = case(rng.normal(0.8, 1, size=40).tolist(), rng.normal(size=100).tolist(), label="a on b", method="a")
    few = [case(turned([0.55, 0.59, 0.63], n), turned(BEFORE, 3 * n), label=f"a on {n}", method="a") for n in range(8)]
    weighted = check_drift([moved, *few])
    assert weighted.detectable["a"] < check_drift([moved]).detectable["a"]
    monkeypatch.setattr(joint_test.Columns, "seen", 1.0)
    assert weighted.rows[0].p_holm < check_drift([moved, *few]).rows[0].p_holm


def test_many_permutations_are_made_where_few_do_not_decide(case, monkeypatch: pytest.MonkeyPatch) -> None:
    made, permuted = [], joint_test._permuted
    monkeypatch.setattr(joint_test, "_permuted", lambda those, count: made.append(count) or permuted(those, count))
    for new, counts in (([0.51, 0.55, 0.59, 0.63], [1_999]), ([0.8] * 4, [1_999, 19_999])):
        made.clear()
        p_by_two = check_drift([case(new, label=f"a on {n}", method="a") for n in range(2)]).rows[0].p_holm
        assert made[:2] == counts
        assert (p_by_two > 0.1) is (len(counts) == 1)


def test_more_seeds_than_the_references_have_prove_nothing_if_those_are_the_same_to_the_bit(trial) -> None:
    """Trials of the references' seeds with the same bits come from the same code, and so do all others of the run."""
    old = tuple(trial(seed, value, "c", digest=str(seed)) for seed, value in enumerate(BEFORE))
    more = tuple(trial(seed, 0.9, "c", digest=str(seed)) for seed in range(10, 20))
    same = DriftCase("a on b", "c", (*old, *more), old, ("score",))
    assert [row.detail for row in check_drift([same]).rows] == ["the same trials to the bit"]
    other = replace(same, new=(replace(old[0], digest="other"), *old[1:], *more))
    mixed = [
        (*old, *(replace(one, provenance=made) for one in more))
        for made in ({"versions": {"jax": "2"}}, {"git": {"sha": "a"}}, {"code_hashes": {"mine.Method": "b"}})
    ]
    for new in (other.new, more, *mixed):
        assert [(row.p is None, row.n_new) for row in check_drift([replace(other, new=new)]).rows] == [
            (False, len(new))
        ]


def test_levels_and_curves_are_measures_too(trial) -> None:
    one = replace(trial(0, 1.0), levels={"success": (0.25, 0.75)}, curves={"nodes": (1.0, 2.0)})
    assert measured(one, "success at level 1") == 0.75
    assert measured(one, "mean nodes while training") == 1.5
    for unknown in ("success at level 2", "mean steps while training", "success"):
        with pytest.raises(KeyError):
            measured(one, unknown)


@pytest.mark.parametrize(
    ("given", "status", "said"),
    [
        ({"new": []}, "not run", "no new trial"),
        ({"new": [0.51, 0.55]}, "underpowered", "the smallest p that 2 against 10 trials allow is 0.0303"),
        ({"reference": BEFORE[:9]}, "no reference", "9 reference trials of this condition, 10 needed"),
        ({"of": "older code"}, "no reference", "10 of another fingerprint left out"),
    ],
)
def test_what_could_show_no_drift_is_said_and_no_pass(case, given, status: str, said: str) -> None:
    report = check_drift([case(**{"new": [0.5] * 5, **given})])
    (row,) = report.rows
    assert (row.status, report.unchecked) == (status, report.rows)
    assert said in row.detail


@pytest.mark.parametrize(
    ("new", "metric", "detail"),
    [
        ([0.5, "crashed"], "score", "crashed: seeds 1"),
        ([0.5, math.nan], "score", "NaN"),
        ([0.5, 0.6], "scroe", "no metric 'scroe'"),
    ],
)
def test_a_metric_that_cannot_be_read_is_an_error_row_beside_the_others(case, new, metric, detail) -> None:
    report = check_drift([case(new, metrics=(metric,)), case([0.9] * 5, method="another")])
    assert report.rows[0].status == "error"
    assert detail in report.rows[0].detail
    assert report.rows[1].drifted


def test_the_report_is_strict_json(case) -> None:
    plain = json.loads(json.dumps(check_drift([case(["diverged"] * 5)]).to_json(), allow_nan=False))
    assert plain["alpha"] == 0.01
    assert plain["rows"][0]["status"] == "drift"


def test_a_difference_that_single_precision_cannot_hold_is_no_drift(case) -> None:
    """The same success, 37.83 of 42 rows, as two releases round its mean: every new value is a little above."""
    before, now = 0.90079361, 0.90079367
    (row,) = check_drift([case([now] * 9 + [0.925], [before] * 9 + [0.859])]).rows
    assert row.status == "no drift"
    assert row.a12 == pytest.approx(0.595)  # 19 of 100 pairs are above, and 81 ties
    assert row.median_new == row.median_ref


def test_a_value_without_limit_is_not_taken_for_the_largest_finite_one(case) -> None:
    (row,) = check_drift([case([math.inf] * 5, [1.0, 2.0] * 5)]).rows
    assert (row.status, row.median_new, row.median_ref) == ("drift", math.inf, 1.5)


def test_values_that_single_precision_tells_apart_are_told_apart(case) -> None:
    assert check_drift([case([0.9008] * 5, [0.9007] * 10)]).drifted


def test_a_pilot_counts_for_the_measures_that_it_has(case, trial) -> None:
    def of(trials, **metrics):  # type: ignore[no-untyped-def]
        return tuple(replace(one, metrics={name: f(one.seed) for name, f in metrics.items()}) for one in trials)

    plain = case([0.0] * 5)
    pilot = tuple(trial(1000 + seed, 0.0, "c") for seed in range(50))
    both = replace(
        plain,
        new=of(plain.new, score=lambda seed: seed / 10, other=float),
        reference=of(plain.reference, score=lambda seed: seed / 10, other=float),
        pilot=of(pilot, score=lambda seed: seed / 10),
        metrics=("score", "other"),
    )
    rows = {row.metric: row for row in check_drift([both]).rows}
    assert (rows["score"].n_ref, rows["other"].n_ref) == (60, 10)
    assert rows["other"].p_holm == pytest.approx(min(rows["score"].p / 0.8, rows["other"].p / 0.2))
    assert rows["score"].drifted or rows["other"].drifted


LEAVES = st.one_of(st.none(), st.booleans(), st.integers(-3, 3), st.text(max_size=3))
SPECS = st.dictionaries(
    st.sampled_from("abc"),
    st.recursive(
        LEAVES, lambda part: st.lists(part, max_size=2) | st.dictionaries(st.sampled_from("xy"), part), max_leaves=4
    ),
)


def test_each_changed_setting_is_named_with_both_values() -> None:
    old = {"method": {"name": "es", "settings": {"sigma": 0.5, "lr": 1}}, "task": {"layers": [4, 4]}, "seed": 1}
    new = {"method": {"name": "es", "settings": {"sigma": 0.3, "rank": True}}, "task": {"layers": [4, 8]}, "seed": 2}
    assert changed_settings(old, new) == (
        "method.settings.lr 1 -> none, method.settings.rank none -> True, method.settings.sigma 0.5 -> 0.3, "
        "task.layers.1 4 -> 8"
    )


def test_many_changes_are_counted() -> None:
    old, new = ({str(at): value for at in range(MOST + 3)} for value in (0, 1))
    assert changed_settings(old, new).endswith(", and 3 more")


@given(SPECS, SPECS)
@settings(max_examples=40)
def test_nothing_is_named_exactly_where_nothing_differs(old: dict[str, Any], new: dict[str, Any]) -> None:
    assert (changed_settings(old, new) == "") == (repr(_sorted(old)) == repr(_sorted(new)))


def _sorted(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _sorted(value[key]) for key in sorted(value)}
    return [_sorted(part) for part in value] if isinstance(value, list) else value


def test_an_edited_robot_is_named_by_its_file_not_by_hashes() -> None:
    old = {"task": {"robot": {"xml": "mine:rover.xml", "body": "1f", "frames": 5}}}
    edited = {"task": {"robot": {**old["task"]["robot"], "body": "2e"}}}
    other = {"task": {"robot": {"xml": "mine:car.xml", "body": "2e", "frames": 5}}}
    assert changed_settings(old, edited) == (
        "task.robot.xml 'mine:rover.xml': this file, or one that it includes, was edited"
    )
    assert changed_settings(old, other) == "task.robot.xml 'mine:rover.xml' -> 'mine:car.xml'"
    old["task"]["robot"].pop("body")  # a trial from before there was a hash
    assert changed_settings(old, edited) == "task.robot.body none -> '2e'"
    assert changed_settings({"body": "1f"}, {"body": "2e"}) == "body '1f' -> '2e'"
