"""The judge: attainability first, looks, curtailment, errors."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from evoclaims.judging.design import FIXED_10, SEQUENTIAL, THREE_LOOKS, Design, Look
from evoclaims.judging.judge import attainability, judge, needed_trials
from evoclaims.judging.measure import Event
from evoclaims.judging.verdict import Outcome

HIGH, LOW = [float(i) for i in range(10, 20)], [float(i) for i in range(10)]


def test_an_underpowered_claim_is_never_looked_at(source) -> None:
    a, b = source("a", HIGH), source("b", LOW)
    verdict = judge(a.score() > b.score(), Design.fixed(2))
    assert verdict.outcome is Outcome.INCONCLUSIVE
    assert verdict.reason == "underpowered: needs n = 3 at alpha = 0.05"
    assert a.asked == b.asked == []
    assert (verdict.n, verdict.attainable_p) == (0, pytest.approx(1 / 6))


@pytest.mark.parametrize(
    ("kind", "n"), [("greater", 3), ("solves", 9), ("band", 5), ("trend", 5), ("equivalent", 3), ("exact", 1)]
)
def test_the_needed_trials_are_the_fewest_that_could_support(source, kind, n) -> None:
    a, b = source("a", HIGH), source("b", LOW)
    assertion = {
        "greater": lambda: a.score() > b.score(),
        "solves": lambda: a.solved().in_most_trials(),
        "band": lambda: a.score().between(0, 1),
        "trend": lambda: a.success(3).falls(),
        "equivalent": lambda: a.score().equivalent_to(b.score(), margin=1.0),
        "exact": lambda: a.solved().in_every_trial(),
    }[kind]()
    assert needed_trials(assertion, FIXED_10) == n
    ((look, p),) = attainability(assertion, Design.fixed(n))
    assert p.supported <= look.alpha


def test_support_that_no_size_reaches_is_said_so(source) -> None:
    event = source("a", [0.5] * 10).solved()
    assertion = event.in_most_trials(p0=0.999)
    assert needed_trials(assertion, FIXED_10) is None
    assert "no n up to 100 suffices" in judge(source("a", [1.0] * 10).solved().stays(p0=0.999), FIXED_10).reason


def test_a_direction_out_of_reach_is_named_in_the_reason(source) -> None:
    verdict = judge(source("a", [1.0] * 5).solved().in_most_trials(), Design.fixed(5))
    assert verdict.outcome is Outcome.INCONCLUSIVE
    assert "underpowered for support: needs n = 9" in verdict.reason


def test_ties_that_leave_no_direction_open_are_underpowered(source) -> None:
    verdict = judge(source("a", [1.0] * 10).score() > source("b", [1.0] * 10).score(), FIXED_10)
    assert verdict.outcome is Outcome.INCONCLUSIVE
    assert verdict.reason == "all 10 and 10 trials have the value 1: nothing to compare"
    assert verdict.attainable_p == 1.0


def test_a_clear_difference_ends_at_the_first_look(source) -> None:
    a, b = source("a", HIGH), source("b", LOW)
    verdict = judge(a.score() > b.score(), SEQUENTIAL)
    assert (verdict.outcome, verdict.n, verdict.alpha) == (Outcome.SUPPORTED, 5, 0.01)
    assert a.asked == b.asked == [(0, 1, 2, 3, 4)]


def test_an_open_claim_goes_on_to_the_next_look(source) -> None:
    a, b = source("a", [0.5, *HIGH[1:]]), source("b", LOW)
    verdict = judge(a.score() > b.score(), SEQUENTIAL)
    assert (verdict.outcome, verdict.n, verdict.alpha) == (Outcome.SUPPORTED, 10, 0.04)
    assert a.asked == [tuple(range(5)), tuple(range(10))]


def test_a_look_that_can_decide_nothing_is_skipped(source) -> None:
    a, b = source("a", HIGH), source("b", LOW)
    verdict = judge(a.score() > b.score(), Design((Look(2, 0.01), Look(10, 0.04))))
    assert (verdict.outcome, a.asked) == (Outcome.SUPPORTED, [tuple(range(10))])


def test_seeds_start_where_the_design_says(source, trial) -> None:
    a = source("a", LOW)
    judge(a.solved().in_every_trial(), Design((Look(3, 0.05),), first_seed=4))
    assert a.asked == [(4, 5, 6)]


def test_four_of_five_solved_is_curtailed_since_nothing_can_change_the_verdict(source) -> None:
    a = source("a", [1.0, 1.0, 0.0, 1.0, 1.0] + [1.0] * 5)
    verdict = judge(a.solved().in_most_trials(), SEQUENTIAL)
    assert (verdict.outcome, verdict.n) == (Outcome.INCONCLUSIVE, 5)
    assert "stopped early" in verdict.reason
    assert a.asked == [(0, 1, 2, 3, 4)]


def test_a_verdict_that_every_completion_reaches_is_given_early(source) -> None:
    # 8 of 9 have p = 0.0195 at p0 = 0.5: not decisive at 0.003, but even 8 of 10 (p = 0.055) is at 0.06.
    looks = (Look(9, 0.003), Look(10, 0.06))
    supported = judge(source("a", [1.0] * 8 + [0.0]).solved().stays(p0=0.5), Design(looks))
    refuted = judge(source("a", [0.0] * 8 + [1.0]).solved().stays(p0=0.5), Design(looks))
    assert [(v.outcome, v.n) for v in (supported, refuted)] == [(Outcome.SUPPORTED, 9), (Outcome.REFUTED, 9)]
    assert "stopped early" in supported.reason


def test_a_claim_that_can_still_be_refuted_goes_on(source) -> None:
    a = source("a", [1.0, 1.0] + [0.0] * 8)
    verdict = judge(a.solved().in_most_trials(), SEQUENTIAL)
    assert (verdict.outcome, verdict.n) == (Outcome.REFUTED, 10)


@pytest.mark.parametrize("kind", ["solves", "band", "greater", "falls", "and", "or"])
@given(data=st.data())
@settings(deadline=None, max_examples=10, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_bounds_hold_for_every_completion(kind, data, source) -> None:
    """Every completion of 2 trials to 4 gives p between the bounds (values from a small alphabet)."""
    rows = list(product([0.0, 1.0, 2.0], repeat=2)) if kind == "falls" else ["diverged", 0.5, 1.0, 7.0]
    old = data.draw(st.lists(st.sampled_from(rows), min_size=2, max_size=2))
    other = data.draw(st.lists(st.sampled_from(rows), min_size=4, max_size=4))

    def assertion(values):  # type: ignore[no-untyped-def]
        a, b = source("a", values), source("b", other)
        return {
            "solves": lambda: a.solved().in_most_trials(),
            "band": lambda: a.score().between(1, 2),
            "greater": lambda: a.score() > b.score(),
            "falls": lambda: a.success(2).falls(),
            "and": lambda: a.solved().stays() & a.score().between(1, 2),
            "or": lambda: a.solved().stays() | a.score().between(1, 2),
        }[kind]()

    def trials(claim, n):  # type: ignore[no-untyped-def]
        return {s.fingerprint: tuple(s.fetch(range(n))) for s in claim.sources()}

    early = assertion(old)
    low, high = early.bounds(trials(early, 2), 4, FIXED_10)
    for new in product(rows, repeat=2):
        full = assertion([*old, *new])
        p = full.find(trials(full, 4), FIXED_10, 0.05).p
        assert low.supported - 1e-12 <= p.supported <= high.supported + 1e-12
        assert low.refuted - 1e-12 <= p.refuted <= high.refuted + 1e-12


def test_the_order_in_which_a_source_returns_trials_does_not_matter(source) -> None:
    a, b = [3.0, 1, 4, 1, 5, 9, 2, 6, 5, 3], [2.0, 7, 1, 8, 2, 8, 1, 8, 2, 8]
    verdicts = [
        judge(source("a", a, backwards).score() > source("b", b).score(), FIXED_10) for backwards in (False, True)
    ]
    assert verdicts[0] == verdicts[1]


def test_a_crashed_trial_makes_the_verdict_an_error(source) -> None:
    verdict = judge(source("a", [*HIGH[:9], "crashed"]).score() > source("b", LOW).score(), FIXED_10)
    assert verdict.outcome is Outcome.ERROR
    assert verdict.reason == "1 of 10 trials of a crashed (seed 9)"
    several = judge(source("a", ["crashed", 1.0] * 5).score() > source("b", LOW).score(), FIXED_10)
    assert several.reason == "5 of 10 trials of a crashed (seeds 0, 2, 4, 6, 8)"


def test_a_crash_is_seen_in_each_of_two_conditions_of_one_name(source) -> None:
    plain, crashed = source("a", HIGH), source("a", ["crashed", *LOW[1:]])
    other = type("Other", (type(crashed),), {"fingerprint": "another id"})("a", crashed.trials)
    for one, two in ((plain, other), (other, plain)):
        assert judge(one.score() > two.score(), FIXED_10).outcome is Outcome.ERROR


def test_nan_in_a_finished_trial_makes_the_verdict_an_error(source) -> None:
    verdict = judge(source("a", [*HIGH[:9], math.nan]).solved().stays(), FIXED_10)
    assert verdict.outcome is Outcome.ERROR
    assert "NaN" in verdict.reason


def test_what_a_source_raises_reaches_the_caller(source) -> None:
    with pytest.raises(KeyError):
        judge(source("a", [1.0]).solved().in_every_trial(), Design.fixed(3))


def test_a_source_that_returns_other_seeds_is_a_mistake(source, trial) -> None:
    a = source("a", LOW)
    a.trials[2] = trial(7, 1.0)
    with pytest.raises(ValueError, match="returned the seeds"):
        judge(a.solved().in_every_trial(), Design.fixed(3))


def test_a_control_beside_a_test_waits_for_every_trial(source) -> None:
    a = source("a", [1.0] * 10)
    verdict = judge(a.solved().in_every_trial() & a.score().between(0, 2), SEQUENTIAL)
    assert (verdict.outcome, a.asked) == (Outcome.SUPPORTED, [tuple(range(10))])


def test_a_verdict_says_which_trials_took_the_worst_rank_and_why(source) -> None:
    broken = source("a", ["timeout", 5.0, "diverged", "timeout", *[5.0] * 6])
    verdict = judge(broken.score() > source("b", [1.0] * 10).score(), FIXED_10)
    assert verdict.without_result == (
        "1 of 10 trials of a diverged (seeds 2); 2 of 10 trials of a ran out of time (seeds 0, 3)"
    )
    assert judge(source("a", HIGH).score() > source("b", LOW).score(), FIXED_10).without_result == ""


def _with_champions(source, label, champions, curves=((1.0,),), values=(1.0,) * 10):  # type: ignore[no-untyped-def]
    """Return a source of trials with these champions and training curves, each in turn."""
    made = source(label, list(values))
    for seed, trial in made.trials.items():
        curve = curves[seed % len(curves)]
        made.trials[seed] = replace(trial, champion=champions[seed % len(champions)], curves={"fitness": curve})
    return made


def test_trials_that_are_all_copies_of_one_are_no_evidence(source) -> None:
    a = _with_champions(source, "a", ["one"])
    verdict = judge(a.solved().in_most_trials() & (a.score() > 0.5), FIXED_10)
    assert verdict.outcome is Outcome.INCONCLUSIVE
    assert verdict.reason.startswith("all 10 trials of a are copies of one: training gave the same, whatever the seed")
    assert judge(a.solved().in_every_trial(), FIXED_10).outcome is Outcome.SUPPORTED
    assert judge(a.solved().in_every_trial() & (a.score() > 0.5), FIXED_10).outcome is Outcome.INCONCLUSIVE
    a.deterministic = True
    assert judge(a.score() > 0.5, FIXED_10).outcome is Outcome.SUPPORTED


@pytest.mark.parametrize(
    ("champions", "curves"),
    [(list("abcdefghij"), [(1.0,)]), (["a"], [(float(n),) for n in range(10)]), ([""], [(1.0,)])],
    ids=["different champions", "different curves", "no champions"],
)
def test_trials_that_differ_or_keep_no_champion_are_evidence(source, champions, curves) -> None:
    a = _with_champions(source, "a", champions, curves)
    verdict = judge(a.solved().in_most_trials(), FIXED_10)
    assert (verdict.outcome, verdict.n) == (Outcome.SUPPORTED, 10)
    assert verdict.reason.startswith("p = ")


def _of_a_loop(source, label, values, returned):  # type: ignore[no-untyped-def]
    """Return a source of trials of a training loop; of each seed, curve, metrics, actions, and whether these grade."""
    made = source(label, values)
    for seed, trial in made.trials.items():
        curve, metrics, actions, graded = returned(seed)
        marks = {"metrics": str(metrics), "actions": str(actions), "graded": graded}
        curves = {"fitness": (curve,)} if curve is not None else {}
        provenance = {"trained_by": "loops:one", "returned": marks}
        made.trials[seed] = replace(trial, champion="", curves=curves, digest=str(seed), provenance=provenance)
    return made


@pytest.mark.parametrize(
    ("returned", "distinct"),
    [
        (lambda seed: (0.857, 0, "", False), 1),  # curves alone
        (lambda seed: (None, 100, "", False), 1),  # metrics alone, whole
        (lambda seed: (None, 0, "acts", False), 1),  # a policy alone
        (lambda seed: (0.857, f"took {seed} s", "", False), 1),  # wall times hide nothing
        (lambda seed: (None, f"took {seed} s", "acts", True), 1),
        (lambda seed: (0.857 + seed % 2, 0, "", False), 2),
        (lambda seed: (None, seed % 2, "", False), 2),
        (lambda seed: (None, 0, seed // 2, False), 5),
        (lambda seed: (None, min(seed, 8), "", False), 9),
        (lambda seed: (500.0, seed, "", False), 10),  # whole curves may be equal by chance
        (lambda seed: (0.857, 0, seed, False), 10),  # so may those of a schedule, where policies differ
        (lambda seed: (0.857 + seed, 0, "acts", True), 10),
    ],
)
def test_copies_of_a_training_loop_count_once(source, returned, distinct) -> None:
    a, b = _of_a_loop(source, "a", HIGH, returned), source("b", LOW)
    for assertion in (a.solved().in_most_trials(), a.score() > b.score(), b.score() < a.score()):
        verdict = judge(assertion, FIXED_10)
        if distinct == 10:
            assert "copies" not in verdict.reason
            assert verdict.n == 10
            continue
        assert "copies" in verdict.reason
        attainable = assertion.attainable(distinct, FIXED_10).supported <= FIXED_10.alpha
        assert (verdict.outcome is Outcome.SUPPORTED) == (distinct > 1 and attainable)
        if distinct > 1:
            assert verdict.n == 10
            assert f"which count once: n = {distinct} instead of 10" in verdict.reason
            alone = judge(assertion, replace(FIXED_10, looks=(Look(distinct, FIXED_10.alpha),)))
            if returned(9) != returned(0) and distinct == 9:  # the first nine seeds are those that count
                assert (verdict.p, verdict.outcome) == (alone.p, alone.outcome)


def test_copies_are_named_by_their_seeds_and_support_nothing_alone(source) -> None:
    a = _of_a_loop(source, "a", HIGH, lambda seed: (0.5 + seed % 2, 0, "", False))
    verdict = judge(a.score() > source("b", LOW).score(), FIXED_10)
    assert verdict.outcome is Outcome.INCONCLUSIVE
    assert "a has copies of the same training (seeds 0, 2, 4, 6, 8; seeds 1, 3, 5, 7, 9)" in verdict.reason
    assert "underpowered: needs n = " in verdict.reason


def test_equal_trials_that_may_be_chance_do_not_make_what_is_rare_look_usual(source) -> None:
    """Four of ten trials fail, each in its way; the six that succeed are equal: left out, most trials would fail."""
    a = _of_a_loop(source, "a", [1.0] * 6 + [0.0] * 4, lambda seed: (None, max(seed, 5), "", False))
    at_half = replace(FIXED_10, looks=(Look(10, 0.2),))
    fails = Event(a, "fails", lambda trial: not trial.metrics["score"])
    verdict = judge(fails.in_most_trials(0.5), at_half)
    assert "n = 5 instead of 10" in verdict.reason
    assert verdict.outcome is Outcome.INCONCLUSIVE


def test_a_second_look_goes_on_behind_copies_in_the_first(source) -> None:
    a = _of_a_loop(source, "a", HIGH, lambda seed: (max(seed, 1) + 0.5, 0, "", False))
    verdict = judge(a.solved().in_most_trials(0.5), replace(FIXED_10, looks=(Look(5, 0.01), Look(10, 0.04))))
    assert (verdict.outcome, verdict.n) == (Outcome.SUPPORTED, 10)
    assert "n = 9 instead of 10" in verdict.reason


def test_what_is_smaller_than_claimed_is_not_saved_by_copies_in_a_later_look(source) -> None:
    order = [0, 9, 1, 8, 2, 7, 3, 6, 4, 5]
    champions = [str(seed) for seed in range(29)]
    a = _with_champions(source, "a", [*champions, champions[-1]], [(0.5,)], [*order, *range(100, 120)])
    b = source("b", [*(2.5 + one for one in order), *range(-100, -120, -1)])
    verdict = judge(a.score() > b.score(), Design(THREE_LOOKS))
    assert (verdict.outcome, verdict.n) == (Outcome.SMALLER, 10)
    assert verdict.reason.startswith("more trials do not refute it: of n = 10, p = ")


def test_copies_and_a_table_too_short_for_the_next_look_are_each_a_clause(source) -> None:
    a = _of_a_loop(source, "a", HIGH, lambda seed: (max(seed, 3) + 0.5, 0, "", False))
    a.existing = 5
    verdict = judge(a.solved().in_most_trials(), replace(FIXED_10, looks=(Look(5, 0.04), Look(10, 0.01))))
    assert verdict.reason == (
        "a has copies of the same training (seeds 0, 1, 2, 3), which count once: n = 2 instead of 5; underpowered: "
        "needs n = 13 at alpha = 0.01; underpowered: needs n = 10 trials of a, and there are 5"
    )
    assert verdict.copies == "a has copies of the same training (seeds 0, 1, 2, 3)"


def test_trials_of_a_training_loop_in_a_pilot_which_keeps_no_digests_are_evidence(source) -> None:
    a = source("a", [1.0] * 10)
    told = {"champion": "", "digest": "", "curves": {"fitness": (0.857,)}, "provenance": {"trained_by": "loops:one"}}
    for seed, trial in a.trials.items():
        a.trials[seed] = replace(trial, **told)
    assert judge(a.solved().in_most_trials(), FIXED_10).outcome is Outcome.SUPPORTED


def test_what_is_smaller_than_claimed_at_five_trials_may_be_refuted_at_ten(source) -> None:
    # Of two parts, complete separation at n = 5 has p = 0.008 against the order and 0.004 against the size.
    a, b = source("a", LOW), source("b", HIGH)
    both = (a.score() > b.score()) & (a.score() > source("c", HIGH).score())
    only = Design(SEQUENTIAL.looks[:1])
    assert judge(both & (a.score() < b.score()), only).outcome is Outcome.SMALLER
    verdict = judge(both & (a.score() < b.score()), SEQUENTIAL)
    assert (verdict.outcome, verdict.n) == (Outcome.REFUTED, 10)


def test_what_is_smaller_than_claimed_at_five_trials_stays_so_unless_refuted(source) -> None:
    # All pairs are lost at n = 5; then all others are above. With three parts the rank test does not reject.
    a, b = source("a", [*LOW[:5], *[99.0] * 5]), source("b", HIGH)
    holds = source("c", [1.0] * 10).solved().in_most_trials(p0=0.3)
    verdict = judge((a.score() > b.score()) & holds & holds, SEQUENTIAL)
    assert (verdict.outcome, verdict.n) == (Outcome.SMALLER, 5)
    assert verdict.reason.startswith("more trials do not refute it: of n = 5, p = 0.00615 against an effect as large")
    assert a.asked == [tuple(range(5)), tuple(range(10))]
