"""What is read from trials: failed trials are worst, NaN is an error, and sentences read well."""

from __future__ import annotations

import math
import operator
from dataclasses import replace

import numpy as np
import pytest

from evoclaims.core.errors import UserError
from evoclaims.judging.design import Design
from evoclaims.judging.kinds.greater import Greater
from evoclaims.judging.kinds.threshold import Threshold
from evoclaims.judging.measure import Event, Measure, Profile
from evoclaims.judging.sample import UnreadableTrialError
from evoclaims.judging.window import Window


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


def test_a_failed_trial_is_flat_and_worst_in_a_profile(source) -> None:
    ppo = source("ppo", [(1.0, 0.5), "diverged"])
    assert ppo.success(2).rows(fetched(ppo, 2)) == ((1.0, 0.5), (-math.inf, -math.inf))


def test_nan_in_a_curve_that_is_read_is_an_error(source) -> None:
    """An event that compares it would not hold, and the claim be refuted."""
    broken = source("neat", [1.0])
    broken.trials[0] = replace(broken.trials[0], curves={"nodes": (7.0, math.nan), "success": (0.0, 1.0)})
    grown = Event(broken, "grown", lambda trial: trial.curves["nodes"][-1] > 5)
    with pytest.raises(UnreadableTrialError, match="'nodes' is NaN in the finished trial of seed 0"):
        grown.sample(fetched(broken, 1))
    learnt = Event(broken, "learnt", lambda trial: trial.curves["success"][-1] == 1)
    assert learnt.sample(fetched(broken, 1)).values == (1.0,)


def test_a_level_of_a_profile_is_a_measure(source) -> None:
    ppo = source("ppo", [(1.0, 0.5)])
    at = ppo.success(2).at(1)
    assert at.describe() == "ppo: success at level 1"
    assert at.sample(fetched(ppo, 1)).values == (0.5,)


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


def with_unit(measure: Measure, unit: str) -> Measure:
    return replace(measure, unit=unit)


def within(measure: Measure, limit: float, every: float = 0.0) -> Measure:
    return measure.seen_through(Window(limit, every))


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda a, b: a.score() > b.score("lower"), "one direction"),
        (lambda a, b: a.score("larger"), "higher, lower"),
        (lambda a, b: a.success(2).at(0) > a.success(2).at(1), "same trials"),
        (lambda a, b: a.success(2).at(0).equivalent_to(a.success(2).at(1), margin=0.1), "same trials"),
        (lambda a, b: Greater(with_unit(a.score(), "m"), with_unit(b.score(), "km")), "have different units"),
        (lambda a, b: Greater(within(a.score(), 100.0), within(b.score(), 50.0)), "not observed up to the same limit"),
        (
            lambda a, b: within(a.score(), 100.0, 20.0) > within(b.score(), 100.0, 25.0),
            "multiples of 20 and 25 up to 100",
        ),
        (lambda a, b: within(a.score(), 100.0, 20.0) > within(b.score(), 10.0), "with reports equally far apart"),
        *(
            (lambda a, b, margin=margin: a.score().equivalent_to(b.score(), margin=margin), "margin")
            for margin in (0.0, -1.0, math.inf, math.nan)
        ),
        *(
            (lambda a, b, ends=ends: a.score().between(*ends), "band")
            for ends in ((2, 1), (-math.inf, 1), (0, math.inf), (math.nan, 1), ("a", 1))
        ),
        *((lambda a, b, p0=p0: a.solved().in_most_trials(p0), "p0") for p0 in (0.0, 1.0)),
        *((lambda a, b, x=x: a.score() > x, "finite number") for x in (math.inf, -math.inf, math.nan)),
        (lambda a, b: a.score() > True, r"is compared with True\. Use another measure"),
        (lambda a, b: a.score() < "90", r"is compared with '90'\. Use another measure or a number"),
        *(
            (lambda a, b, it=it: it(a.score(), 90), "by > or <, and not by >= or <=")
            for it in (operator.ge, operator.le)
        ),
        (lambda a, b: a.score() >= b.score(), "'a: score' is compared by > or <"),
        (lambda a, b: Threshold(a.score(), "over", 1.0), "above, below"),
        *(
            (lambda a, b, factor=factor: a.score() * factor, "is multiplied by .* Use a finite number above 0")
            for factor in (0, -1, math.inf, math.nan, True, "2")
        ),
        (lambda a, b: a.solved().stays() & 3, "parentheses"),
        (lambda a, b: a.success(1), "a profile needs at least 2"),
        (lambda a, b: a.success(2).at(2), "levels 0 to 1, not 2"),
        (lambda a, b: a.success(4).above(b.success(3), beyond=0), "cannot be compared"),
        *((lambda a, b, x=x: a.success(4).above(b.success(4), beyond=x), "cannot be compared") for x in (3, -1)),
    ],
)
def test_what_cannot_be_asserted_is_a_sentence(source, make, said) -> None:
    with pytest.raises(UserError, match=said):
        make(source("a", []), source("b", []))


def test_numbers_of_numpy_are_numbers(source) -> None:
    score = source("a", []).score()
    assert (score > np.float32(2)).plain() == (score > 2).plain() == (2 < score).plain()  # noqa: SIM300


@pytest.mark.parametrize(
    ("value", "reading", "said"),
    [
        (math.nan, lambda a: a.score(), "'score' is NaN in the finished trial of seed 0"),
        (math.nan, lambda a: a.solved(), "'score' is NaN in the finished trial of seed 0"),
        (math.nan, lambda a: Measure(a, "clipped", lambda t: max(0.0, t.metrics["score"])), "'score' is NaN"),
        (
            1.0,
            lambda a: Measure(a, "made nan", lambda t: math.nan),
            "a: made nan is NaN in the finished trial of seed",
        ),
        ((1.0, math.nan), lambda a: a.success(2), "'success' is NaN"),
        ((1.0, 2.0), lambda a: Profile(a, "computed", lambda t: (0.0, math.nan), 2), "a: computed is NaN"),
        ((1.0, 0.5, 0.2), lambda a: a.success(2), "3 levels instead of 2"),
        (
            1.0,
            lambda a: Measure(a, "misspelled", lambda t: t.metrics["scor"]),
            r"no 'scor' in the finished trial of seed 0 .*\. Did you mean 'score'\? Known: score\.$",
        ),
        *(  # a forgotten comparison would hold of every number but 0, and a forgotten return of none
            (1.0, lambda a, given=given: Event(a, "fast", lambda t: given), "'a: fast' is .* neither True nor False")
            for given in (None, 1.0, "yes", (True,))
        ),
        *(
            (
                1.0,
                lambda a, it=it: Measure(a, "odd", lambda t: it),
                "odd is .*, and no number, in the finished trial",
            )
            for it in (None, [1.0, 2.0], "much")
        ),
    ],
)
def test_what_cannot_be_read_of_a_finished_trial_is_an_error(source, value, reading, said) -> None:
    read = reading(source("a", [value]))
    with pytest.raises(UnreadableTrialError, match=said):
        (read.rows if isinstance(read, Profile) else read.sample)(fetched(read.source, 1))


def test_an_event_may_ask_whether_there_is_a_number_and_may_be_a_boolean_of_numpy(source) -> None:
    ppo = source("ppo", [1.0])
    for holds, value in ((lambda trial: "scor" in trial.metrics, 0.0), (lambda trial: np.float32(1) > 0, 1.0)):
        assert Event(ppo, "optional", holds).sample(fetched(ppo, 1)).values == (value,)
