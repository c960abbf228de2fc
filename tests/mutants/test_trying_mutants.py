"""What a call adds to the matrix, what it leaves as it was, and what it takes out."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

from hand_made_verdicts import report, verdict
from made_trials import trial_of

from evoclaims.envs.gates.parity import NParity
from evoclaims.judging.design import Design
from evoclaims.judging.verdict import Outcome
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.mutants.mutant import Planted
from evoclaims.mutants.trying import Comparison, merged, noticed
from evoclaims.trials.spec import Budget, Condition
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.history import key_of
from evoclaims.verdicts.mutation_matrix import Attempt, Fate, Sensitivity
from evoclaims.verdicts.source_trials import SourceTrials

CONDITION = Condition(HandBuilt(), NParity(2), "curriculum", Budget(generations=1))
NAMES = ("neat", "maze")
BLIND = Planted("blind", "task", "maze", {NAMES: CONDITION})
MINIMIZES = Planted("minimizes", "method", "neat", {NAMES: CONDITION})


def judged(outcome: str = "supported", *, task: str = "maze") -> ClaimReport:
    source = SourceTrials("neat", task, "c" * 64, (), {}, ())
    return report("A", outcome, verdict=None if outcome == "not run" else verdict(outcome), sources=(source,))


class _Compared:
    """Stands for a comparison of trials: none is equivalent, and only what reads stones has drifted."""

    def equivalent(self, names: Any, faulty: Condition, curves: Any) -> bool:
        return False

    def drifted(self, names: Any, faulty: Condition, reads: Any) -> bool:
        return "metrics.stones" in reads


class _SameEnds(_Compared):
    """The same, but the trials differ in their curves alone."""

    def equivalent(self, names: Any, faulty: Condition, curves: Any) -> bool:
        return not curves


def tried(planted: Planted, sound: ClaimReport, faulty: ClaimReport, failed: Any = ()) -> Sensitivity | None:
    return noticed(cast(Comparison, _Compared()), [sound], [planted], [[faulty]], failed).get(key_of(sound))


def test_a_fault_is_tried_where_its_conditions_have_run_and_the_claim_is_about_them() -> None:
    row = tried(BLIND, judged(), judged("refuted"))
    assert row is not None
    assert (row.outcome, row.methods, row.named(Fate.KILLED)) == (Outcome.SUPPORTED, ("neat",), ("maze: blind",))
    for faulty, sound in (("not run", judged()), ("refuted", judged(task="room"))):
        row = tried(BLIND, sound, judged(faulty))
        assert row is not None
        assert row.attempts == ()
    assert tried(BLIND, judged("not run"), judged("refuted")) is None


def test_a_condition_that_has_just_failed_is_broken_and_one_that_was_not_run_is_not() -> None:
    row = tried(BLIND, judged(), judged("not run"), failed={("maze: blind", NAMES)})
    assert row is not None
    assert row.named(Fate.BROKEN) == ("maze: blind",)
    row = tried(BLIND, judged(), judged("not run"), failed={("neat: minimizes", NAMES)})
    assert row is not None
    assert row.attempts == ()


def test_trials_out_of_time_are_broken_and_kill_nothing() -> None:
    """Nothing is known of their results, and a fault may well make trials slower."""
    late = judged("inconclusive")
    assert late.verdict is not None
    late = replace(late, verdict=replace(late.verdict, without_result="3 of 10 trials of neat ran out of time"))
    undecided, refuted = judged("inconclusive"), judged("refuted")
    for sound, faulty, fate in (
        (judged(), late, Fate.BROKEN),
        (judged(), undecided, Fate.KILLED),
        (late, refuted, Fate.BROKEN),
        (undecided, refuted, Fate.KILLED),
    ):
        row = tried(BLIND, sound, faulty)
        assert row is not None
        assert row.named(fate) == ("maze: blind",)


def test_drift_is_asked_of_what_any_claim_reads_of_the_condition() -> None:
    """As in a run of pytest, which tests it together for all claims."""
    other = judged()
    other = replace(other, claim="B", sources=tuple(replace(one, reads=("metrics.stones",)) for one in other.sources))
    rows = noticed(cast(Comparison, _Compared()), [judged(), other], [BLIND], [[judged(), other]], ())
    assert rows["smoke", "A"].named(Fate.DRIFTED) == ("maze: blind",)


def test_trials_that_differ_in_a_curve_are_not_equivalent_for_a_claim_that_reads_it() -> None:
    """Else a claim that did not notice the fault would be spared it."""
    for reads, fate in (("metrics.reward", Fate.EQUIVALENT), ("curves.fitness", Fate.SURVIVED)):
        sound = judged()
        sound = replace(sound, sources=tuple(replace(one, reads=(reads,)) for one in sound.sources))
        row = noticed(cast(Comparison, _SameEnds()), [sound], [BLIND], [[judged()]], ())[key_of(sound)]
        assert row.named(fate) == ("maze: blind",)


def test_whether_trials_are_equivalent_is_asked_of_levels_metrics_and_some_curves() -> None:
    def trials(condition: Condition, seeds: Any) -> Any:
        curves = {"fitness": (math.nan,), "nodes": (float(condition is faulty),)}
        return [trial_of(condition, seed, 0.5, curves=curves) for seed in seeds]

    faulty = replace(CONDITION, budget=Budget(generations=2))
    tier = SimpleNamespace(design=Design.fixed(2), condition=lambda *_: CONDITION)
    archive, paper = SimpleNamespace(trials=trials), SimpleNamespace(tier=lambda _: tier)
    comparison = Comparison(cast(Any, archive), cast(Any, paper), "smoke", frozenset())
    found = [comparison.equivalent(NAMES, faulty, curves) for curves in ((), ("fitness",), ("fitness", "nodes"))]
    assert found == [True, True, False]


def attempt(planted: Planted, fate: Fate) -> Attempt:
    return Attempt(planted.mutant, planted.part, planted.target, Outcome.REFUTED, fate)


KEY = ("smoke", "A")
BEFORE = Sensitivity(Outcome.SUPPORTED, "f" * 64, ("neat",), (attempt(BLIND, Fate.SURVIVED),))
NOW = replace(BEFORE, attempts=(attempt(MINIMIZES, Fate.KILLED),))
BOTH = {KEY: ("neat: minimizes", "maze: blind")}


def test_attempts_of_several_calls_add_up_and_new_ones_take_the_place_of_old_ones() -> None:
    row = merged({KEY: BEFORE}, {KEY: NOW}, "smoke", BOTH)[KEY]
    assert [one.name for one in row.attempts] == ["neat: minimizes", "maze: blind"]
    assert row.untried == ()
    again = replace(BEFORE, attempts=(attempt(BLIND, Fate.KILLED),))
    row = merged({KEY: BEFORE}, {KEY: again}, "smoke", BOTH)[KEY]
    assert (row.attempts, row.untried) == (again.attempts, ("neat: minimizes",))


def test_attempts_on_another_verdict_are_forgotten() -> None:
    for changed in (replace(NOW, fingerprint="e" * 64), replace(NOW, outcome=Outcome.REFUTED)):
        row = merged({KEY: BEFORE}, {KEY: changed}, "smoke", BOTH)[KEY]
        assert (row.attempts, row.untried) == (NOW.attempts, ("maze: blind",))


def test_what_no_longer_applies_is_taken_out() -> None:
    full = ("full", "A")
    assert merged({KEY: BEFORE, full: BEFORE}, {}, "smoke", {}) == {full: BEFORE}
    row = merged({KEY: BEFORE}, {KEY: NOW}, "smoke", {KEY: ("neat: minimizes",)})[KEY]
    assert row.attempts == NOW.attempts


def test_a_claim_on_which_nothing_was_tried_keeps_its_row() -> None:
    nothing = replace(BEFORE, attempts=())
    assert merged({KEY: BEFORE}, {KEY: nothing}, "smoke", BOTH)[KEY].attempts == BEFORE.attempts
    assert merged({}, {KEY: nothing}, "smoke", BOTH) == {}
    other = replace(nothing, outcome=Outcome.REFUTED)  # a row of another outcome would be shown and scored
    assert merged({KEY: BEFORE}, {KEY: other}, "smoke", BOTH) == {}
