"""Verdicts then and now, and under variants: each claim is said once, and only what can be compared is a change."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import pytest
from hand_made_verdicts import report, verdict
from hypothesis import given
from hypothesis import strategies as st

from evoclaims.core.errors import UserError
from evoclaims.judging.verdict import Outcome, Verdict
from evoclaims.verdicts.claim_report import ClaimReport, Tally, Tried
from evoclaims.verdicts.transitions import (
    Kind,
    Standing,
    Transition,
    compare,
    counts,
    describe,
    matched,
    matrix,
    parse_patterns,
    standings,
)

OUTCOMES = st.sampled_from(Outcome)
STANDINGS = st.dictionaries(
    st.tuples(st.sampled_from(["smoke", "full"]), st.sampled_from(["G1", "G2[a]", "G10"])),
    st.builds(Standing, OUTCOMES, st.sampled_from(["", "f1", "f2"])),
)
KEY = ("smoke", "G1")
EVERY = parse_patterns("*->*")


def _one(old: Standing | None, new: Standing | None) -> Transition:
    (found,) = compare({KEY: old} if old else {}, {KEY: new} if new else {})
    return found


@given(STANDINGS, STANDINGS)
def test_every_claim_of_either_side_has_exactly_one_transition_which_goes_back_the_other_way(
    old: dict[tuple[str, str], Standing], new: dict[tuple[str, str], Standing]
) -> None:
    there, back = compare(old, new), compare(new, old)
    assert sorted((one.tier, one.claim) for one in there) == sorted(old.keys() | new.keys())
    for one in there:
        assert (one.old, one.new) == (old.get((one.tier, one.claim)), new.get((one.tier, one.claim)))
    for kind in (Kind.SAME, Kind.CHANGED, Kind.NEW_HISTORY):
        assert [one.claim for one in there if one.kind is kind] == [one.claim for one in back if one.kind is kind]
    assert {one.kind for one in compare(old, old)} <= {Kind.SAME, Kind.NOT_RUN}


@pytest.mark.parametrize("old", Outcome)
@pytest.mark.parametrize("new", Outcome)
def test_a_pattern_matches_its_own_change_a_star_every_one_and_neither_a_new_history(
    old: Outcome, new: Outcome
) -> None:
    transition = _one(Standing(old, "f"), Standing(new, "f"))
    for a, b in permutations(Outcome, 2):
        found = [
            bool(matched([transition], parse_patterns(f"{one}->{other}"))) for one in (a, "*") for other in (b, "*")
        ]
        changed = old != new
        assert found == [(a, b) == (old, new), changed and a == old, changed and b == new, changed]
    transition = _one(Standing(old, "a" * 64), Standing(new, "b" * 64))
    assert transition.kind is Kind.NEW_HISTORY or old == new == Outcome.NOT_RUN
    assert matched([transition], EVERY) == ()


def test_several_patterns_are_parted_by_commas() -> None:
    text = " supported -> refuted, *->error ,not run->*,"
    assert parse_patterns(text) == parse_patterns("supported->refuted,*->error,not run->*")
    assert len(parse_patterns(text)) == 3


@given(st.text(max_size=20), st.text(max_size=20), st.sampled_from(Kind))
def test_no_name_can_steer_the_terminal(tier: str, claim: str, kind: Kind) -> None:
    old, new = Standing(Outcome.SUPPORTED, "f"), Standing(Outcome.REFUTED, "f")
    assert describe(Transition(tier, claim, kind, old, new)).isprintable()


def test_a_new_history_says_so_with_both_fingerprints_and_verdicts() -> None:
    transition = _one(Standing(Outcome.SUPPORTED, "a" * 64), Standing(Outcome.REFUTED, "b" * 64))
    assert describe(transition) == (
        "G1 (smoke): a new history begins, since what is judged has changed (fingerprint aaaaaaaaaaaa -> "
        "bbbbbbbbbbbb): refuted now, supported under the old rules"
    )


def test_a_test_that_broke_before_its_rules_were_known_has_changed_its_verdict() -> None:
    transition = _one(Standing(Outcome.SUPPORTED, "a" * 64), Standing(Outcome.ERROR, ""))
    assert describe(transition) == "G1 (smoke): supported -> error"
    assert matched([transition], parse_patterns("*->error")) == (transition,)


def test_a_new_claim_is_no_change_and_one_that_is_gone_is_no_longer_run() -> None:
    new, gone = _one(None, Standing(Outcome.REFUTED, "f")), _one(Standing(Outcome.REFUTED, "f"), None)
    assert (describe(new), describe(gone)) == ("G1 (smoke): refuted, new", "G1 (smoke): gone; it was refuted")
    assert matched([new, gone], EVERY) == (gone,)
    assert matched([gone], parse_patterns("refuted->not run")) == (gone,)
    assert matched([gone], parse_patterns("supported->*,*->refuted")) == ()
    assert counts([new, gone, gone]) == "1 new, 2 gone"


def test_a_claim_never_run_is_neither_new_nor_changed() -> None:
    waiting = Standing(Outcome.NOT_RUN, "f")
    assert {_one(None, waiting).kind, _one(waiting, waiting).kind} == {Kind.NOT_RUN}
    assert _one(Standing(Outcome.SUPPORTED, "f"), waiting).kind is Kind.CHANGED


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "No change of a verdict is named"),
        (" , ", "No change of a verdict is named"),
        ("refuted", "'refuted' is not a change of a verdict. Write OLD->NEW"),
        ("supported->refuted->error", "is not a change of a verdict"),
        ("supported->supported", "never happens: a verdict that stays supported has not changed"),
    ],
)
def test_a_pattern_that_cannot_match_is_one_sentence(text: str, said: str) -> None:
    with pytest.raises(UserError, match=said):
        parse_patterns(text)


def test_a_report_stands_under_its_name_with_its_fingerprint() -> None:
    judged = report("G1", "refuted", case="a", verdict=verdict("refuted", fingerprint="f1"))
    broken = report("G2", "error", tier="full", verdict=None)
    assert standings([judged, broken]) == {
        ("smoke", "G1[a]"): Standing(Outcome.REFUTED, "f1"),
        ("full", "G2"): Standing(Outcome.ERROR, ""),
    }


def _report(claim: str, outcome: Outcome, variant: str = "", tier: str = "smoke") -> ClaimReport:
    return report(claim, outcome, tier=tier, variant=variant)


PLAIN = [_report("A", Outcome.SUPPORTED), _report("B", Outcome.REFUTED), _report("C", Outcome.NOT_RUN)]


def test_claims_that_no_variant_judged_are_left_out() -> None:
    variants = {"x": [_report("A", Outcome.NOT_RUN, "x"), _report("B", Outcome.REFUTED, "x")], "y": []}
    (row,) = matrix(PLAIN, variants)
    assert (row.claim, row.outcomes, row.hangs_on) == ("B", {"x": Outcome.REFUTED}, ())


@pytest.mark.parametrize("plain", Outcome)
@pytest.mark.parametrize("varied", [outcome for outcome in Outcome if outcome is not Outcome.NOT_RUN])
def test_a_claim_hangs_on_a_variant_where_both_have_run_and_their_verdicts_differ(
    plain: Outcome, varied: Outcome
) -> None:
    (row,) = matrix([_report("A", plain)], {"x": [_report("A", varied, "x")]})
    assert (row.plain, row.outcomes) == (plain, {"x": varied})
    assert row.hangs_on == (("x",) if plain is not Outcome.NOT_RUN and plain is not varied else ())


def test_tiers_are_kept_apart() -> None:
    assert matrix(PLAIN[:1], {"x": [_report("A", Outcome.REFUTED, "x", tier="full")]}) == ()


def test_a_variant_that_is_inconclusive_with_fewer_trials_says_nothing_of_the_detail() -> None:
    """The protocol itself was inconclusive at ten trials, before thirty decided."""

    def judged(outcome: Outcome, n: int) -> ClaimReport:
        report = _report("A", outcome)
        return replace(report, verdict=Verdict(outcome, "", "", "f", n=n))

    undecided, refuted = judged(Outcome.INCONCLUSIVE, 10), judged(Outcome.REFUTED, 10)
    (row,) = matrix([judged(Outcome.SUPPORTED, 30)], {"x": [undecided], "y": [refuted]})
    assert (row.hangs_on, row.fewer) == (("y",), {"x"})
    (row,) = matrix([judged(Outcome.SUPPORTED, 10)], {"x": [undecided]})
    assert row.hangs_on == ("x",)
    (row,) = matrix([judged(Outcome.INCONCLUSIVE, 30)], {"x": [undecided]})
    assert (row.hangs_on, row.fewer) == ((), frozenset())


def test_a_variant_whose_trials_ran_out_of_time_says_nothing_of_the_detail() -> None:
    late = Verdict(Outcome.INCONCLUSIVE, "", "", "f", n=10, without_result="a ran out of time (seeds 0)")
    (row,) = matrix(
        [_report("A", Outcome.SUPPORTED)], {"x": [replace(_report("A", Outcome.INCONCLUSIVE), verdict=late)]}
    )
    assert (row.hangs_on, row.fewer) == ((), {"x"})
    (row,) = matrix(
        [replace(_report("A", Outcome.INCONCLUSIVE), verdict=late)], {"x": [_report("A", Outcome.SUPPORTED)]}
    )
    assert (row.hangs_on, row.fewer) == ((), {"x"})


def test_support_that_a_null_agent_has_too_is_no_plain_support_under_a_variant() -> None:
    plain, vacuous = (
        _report("A", Outcome.REFUTED),
        replace(_report("A", Outcome.SUPPORTED), satisfied_by=("no action",)),
    )
    (row,) = matrix([plain], {"x": [replace(vacuous, variant="x")], "y": [_report("A", Outcome.SUPPORTED, "y")]})
    assert (row.plain, row.outcomes) == (Tally.REFUTED, {"x": Tally.VACUOUS, "y": Tally.SUPPORTED})
    (row,) = matrix([vacuous], {"y": [_report("A", Outcome.SUPPORTED, "y")]})
    assert (row.plain, row.hangs_on) == (Tally.VACUOUS, ("y",))
    (row,) = matrix([replace(vacuous, tried=Tried.SENSITIVE)], {"x": [replace(vacuous, variant="x")]})
    assert (row.plain, row.outcomes, row.hangs_on) == (Tally.SUPPORTED, {"x": Tally.SUPPORTED}, ())
