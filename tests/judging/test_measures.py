"""What is read from trials: failed trials are worst, NaN is an error, and sentences read well."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from evoclaims.core.errors import UserError
from evoclaims.judging.design import Design
from evoclaims.judging.kinds.greater import Greater
from evoclaims.judging.measure import Event, Measure, Profile
from evoclaims.judging.sample import UnreadableTrialError


def fetched(source, n):  # type: ignore[no-untyped-def]
    return {source.fingerprint: tuple(source.fetch(range(n)))}


def test_a_measure_reads_one_number_a_trial(source) -> None:
    cma = source("cma_es on n_parity", [1.0, 0.5, 0.25])
    sample = cma.score().sample(fetched(cma, 3))
    assert sample.label == "cma_es on n_parity: score"
    assert (sample.seeds, sample.values, sample.median, sample.failed) == ((0, 1, 2), (1.0, 0.5, 0.25), 0.5, ())


@pytest.mark.parametrize(("better", "worst"), [("higher", -math.inf), ("lower", math.inf)])
@pytest.mark.parametrize("status", ["diverged", "timeout"])
def test_a_failed_trial_takes_the_worst_value(source, status, better, worst) -> None:
    ppo = source("ppo", [1.0, status])
    sample = ppo.score(better).sample(fetched(ppo, 2))
    assert (sample.values, sample.failed) == ((1.0, worst), (1,))


def test_an_event_never_holds_in_a_failed_trial(source) -> None:
    ppo = source("ppo", [1.0, "diverged", 0.0, "timeout"])
    always = Event(ppo, "anything at all", lambda trial: True)
    assert always.sample(fetched(ppo, 4)).values == (1.0, 0.0, 1.0, 0.0)


@pytest.mark.parametrize(("units", "compared"), [(("m", "km"), False), (("m", "m"), True), (("m", ""), True)])
@pytest.mark.parametrize(
    "compare", [lambda a, b: a > b, lambda a, b: 2 * a < b, lambda a, b: a.equivalent_to(b, margin=1)]
)
def test_numbers_of_two_units_are_not_compared(source, units, compared, compare) -> None:
    """But their assertion can be written, so that a claim's other readings are judged."""
    sides = [replace(source(name, [1.0, 2.0]).score(), unit=unit) for name, unit in zip("ab", units, strict=True)]
    assertion = compare(*sides)
    trials = {name: found for side in sides for name, found in fetched(side.source, 2).items()}
    if compared:
        assert assertion.find(trials, Design.fixed(2), 0.05).p
    else:
        with pytest.raises(UnreadableTrialError, match="are not compared: their numbers have different"):
            assertion.find(trials, Design.fixed(2), 0.05)


def test_two_units_are_not_compared_where_all_trials_have_failed(source) -> None:
    a, b = (replace(source(name, ["diverged"] * 2).score(), unit=name) for name in "ab")
    trials = {name: found for side in (a, b) for name, found in fetched(side.source, 2).items()}
    with pytest.raises(UnreadableTrialError, match="different units"):
        (a > b).find(trials, Design.fixed(2), 0.05)


def test_an_assertion_built_by_hand_refuses_two_units(source) -> None:
    a, b = (replace(source(name, [1.0]).score(), unit=name) for name in "ab")
    with pytest.raises(UserError, match="have different units"):
        Greater(a, b)


def test_a_failed_trial_is_flat_and_worst_in_a_profile(source) -> None:
    ppo = source("ppo", [(1.0, 0.5), "diverged"])
    assert ppo.success(2).rows(fetched(ppo, 2)) == ((1.0, 0.5), (-math.inf, -math.inf))


def test_nan_in_a_finished_trial_is_an_error_for_every_kind_of_reading(source) -> None:
    broken, row = source("ppo", [math.nan]), source("ppo", [(1.0, math.nan)])
    hidden = Measure(broken, "made nan", lambda trial: math.nan)
    ignored = Measure(broken, "clipped", lambda trial: max(0.0, trial.metrics["score"]))
    for read in (broken.score(), broken.solved(), hidden, ignored):
        with pytest.raises(UnreadableTrialError, match="NaN in the finished trial of seed 0"):
            read.sample(fetched(broken, 1))
    with pytest.raises(UnreadableTrialError, match="NaN"):
        row.success(2).rows(fetched(row, 1))
    computed = Profile(row, "computed", lambda trial: (0.0, math.nan), 2)
    with pytest.raises(UnreadableTrialError, match="NaN"):
        computed.rows(fetched(row, 1))


def test_nan_in_a_curve_that_is_read_is_an_error(source) -> None:
    """An event that compares it would not hold, and the claim be refuted."""
    broken = source("neat", [1.0])
    broken.trials[0] = replace(broken.trials[0], curves={"nodes": (7.0, math.nan), "success": (0.0, 1.0)})
    grown = Event(broken, "grown", lambda trial: trial.curves["nodes"][-1] > 5)
    with pytest.raises(UnreadableTrialError, match="'nodes' is NaN in the finished trial of seed 0"):
        grown.sample(fetched(broken, 1))
    learnt = Event(broken, "learnt", lambda trial: trial.curves["success"][-1] == 1)
    assert learnt.sample(fetched(broken, 1)).values == (1.0,)


@pytest.mark.parametrize("given", [None, 1.0, "yes", (True,)])
def test_an_event_that_is_neither_true_nor_false_is_an_error(source, given) -> None:
    """A forgotten comparison would hold of every number but 0, and a forgotten return of none."""
    ppo = source("ppo", [1.0])
    with pytest.raises(UnreadableTrialError, match="'ppo: fast' is .* neither True nor False"):
        Event(ppo, "fast", lambda trial: given).sample(fetched(ppo, 1))
    assert Event(ppo, "fast", lambda trial: np.float32(1) > 0).sample(fetched(ppo, 1)).values == (1.0,)


def test_a_misspelled_number_of_a_trial_is_an_error_that_lists_the_known_ones(source) -> None:
    ppo = source("ppo", [1.0])
    with pytest.raises(UnreadableTrialError, match="There is no 'scor' in the finished trial of seed 0") as error:
        Measure(ppo, "misspelled", lambda trial: trial.metrics["scor"]).sample(fetched(ppo, 1))
    assert str(error.value).endswith(". Did you mean 'score'? Known: score.")
    assert Event(ppo, "optional", lambda trial: "scor" in trial.metrics).sample(fetched(ppo, 1)).values == (0.0,)


def test_a_profile_of_another_length_is_an_error(source) -> None:
    ppo = source("ppo", [(1.0, 0.5, 0.2)])
    with pytest.raises(UnreadableTrialError, match="3 levels instead of 2"):
        ppo.success(2).rows(fetched(ppo, 1))


def test_a_level_of_a_profile_is_a_measure(source) -> None:
    ppo = source("ppo", [(1.0, 0.5)])
    at = ppo.success(2).at(1)
    assert at.describe() == "ppo: success at level 1"
    assert at.sample(fetched(ppo, 1)).values == (0.5,)
    with pytest.raises(UserError, match="levels 0 to 1, not 2"):
        ppo.success(2).at(2)


def test_a_profile_of_one_level_is_rejected(source) -> None:
    with pytest.raises(UserError, match="a profile needs at least 2"):
        source("ppo", []).success(1)


def test_assertions_read_as_sentences(source) -> None:
    cma, ppo = source("cma_es", []), source("ppo", [])
    sentences = {
        (cma.score() > ppo.score()): "cma_es: score > ppo: score",
        (ppo.score() < cma.score()): "cma_es: score > ppo: score",
        (cma.score() > 0.5): "the median of cma_es: score is above 0.5",
        (cma.score() < 1e6): "the median of cma_es: score is below 1000000",
        (2 * cma.score() > 0.5 * ppo.score()): "cma_es: 2 × score > ppo: 0.5 × score",
        cma.score().between(4, 6): "the median of cma_es: score lies in [4, 6]",
        cma.score().equivalent_to(ppo.score(), margin=0.1): "cma_es: score is within 0.1 of ppo: score",
        cma.solved().in_most_trials(): "cma_es: solved in most trials",
        cma.solved().stays(): "cma_es: solved in most trials",
        cma.solved().in_every_trial(): "cma_es: solved in every trial",
        cma.success(3).falls(): "cma_es: success falls with the level",
        cma.success(3).rises(): "cma_es: success rises with the level",
        cma.score().never_above_itself(): "cma_es: score is never judged above itself",
        (cma.solved().stays() & cma.success(3).falls()): "(cma_es: solved in most trials) and (cma_es: success falls "
        "with the level)",
        (
            cma.solved().stays() | ppo.solved().stays()
        ): "(cma_es: solved in most trials) or (ppo: solved in most trials)",
    }
    assert {assertion.describe() for assertion in sentences} == set(sentences.values())
    assert all(assertion.describe() == sentence for assertion, sentence in sentences.items())


def test_no_assertion_is_true_or_false_without_a_judge(source) -> None:
    cma, ppo = source("cma_es", []), source("ppo", [])
    greater = cma.score() > ppo.score()
    for assertion in (greater, cma.solved().stays(), greater & greater, greater | greater, cma.success(2).falls()):
        with pytest.raises(
            TypeError, match=r"Write verdict\(a > b\) instead of assert a > b; .* a\.between\(low, high\)"
        ):
            assert assertion
    with pytest.raises(TypeError, match="neither true nor false until it is judged"):
        assert cma.score() > ppo.score() > cma.score()


def test_measures_of_opposite_directions_are_not_compared(source) -> None:
    with pytest.raises(UserError, match="one direction"):
        _ = source("cma_es", []).score() > source("ppo", []).score("lower")


def test_two_readings_of_the_same_trials_are_not_compared_by_rank(source) -> None:
    success = source("cma_es", []).success(2)
    with pytest.raises(UserError, match="same trials"):
        _ = success.at(0) > success.at(1)
    with pytest.raises(UserError, match="same trials"):
        success.at(0).equivalent_to(success.at(1), margin=0.1)


def test_an_unknown_direction_lists_the_known_ones(source) -> None:
    with pytest.raises(UserError, match="higher, lower"):
        source("cma_es", []).score("larger")


@pytest.mark.parametrize("margin", [0.0, -1.0, math.inf, math.nan])
def test_an_equivalence_needs_a_real_margin(source, margin) -> None:
    with pytest.raises(UserError, match="margin"):
        source("cma_es", []).score().equivalent_to(source("ppo", []).score(), margin=margin)


@pytest.mark.parametrize("ends", [(2, 1), (-math.inf, 1), (0, math.inf), (math.nan, 1), ("a", 1)])
def test_a_band_needs_two_finite_ends_in_order(source, ends) -> None:
    with pytest.raises(UserError, match="band"):
        source("cma_es", []).score().between(*ends)


@pytest.mark.parametrize("p0", [0.0, 1.0])
def test_an_overriding_p0_lies_between_0_and_1(source, p0) -> None:
    with pytest.raises(UserError, match="p0"):
        source("cma_es", []).solved().in_most_trials(p0)


def test_only_assertions_are_joined(source) -> None:
    with pytest.raises(UserError, match="parentheses"):
        _ = source("cma_es", []).solved().stays() & 3


def test_compounds_are_flat_and_name_each_condition_once(source) -> None:
    a, b, c = (source(name, []).solved().stays() for name in "abc")
    assert (a | b | c).parts == (a | (b | c)).parts == (a, b, c)
    assert (a & b & c).parts == (a & (b & c)).parts == (a, b, c)
    assert len((a & b | c).parts) == 2
    assert [s.label for s in (a & b & a).sources()] == ["a", "b"]


def test_a_profile_above_another_is_above_at_every_level_beyond(source) -> None:
    high, low = source("cma_es", []).success(4), source("ppo", []).success(4)
    parts = [high.at(level) > low.at(level) for level in (1, 2, 3)]
    assert high.above(low, beyond=0).plain() == (parts[0] & parts[1] & parts[2]).plain()
    assert high.above(low, beyond=2).plain() == parts[2].plain()


@pytest.mark.parametrize(("size", "beyond"), [(3, 0), (4, 3), (4, -1)])
def test_profiles_are_compared_at_levels_that_both_have(source, size, beyond) -> None:
    with pytest.raises(UserError, match="cannot be compared"):
        source("cma_es", []).success(4).above(source("ppo", []).success(size), beyond=beyond)


@pytest.mark.parametrize("answer", [None, [1.0, 2.0], "much"])
def test_a_measure_that_reads_no_number_is_a_sentence_with_its_name(source, answer) -> None:
    a = source("a", [1.0])
    odd = Measure(a, "odd", lambda trial: answer)
    with pytest.raises(UnreadableTrialError, match="odd is .*, and no number, in the finished trial of seed 0"):
        odd.sample(fetched(a, 1))
