"""Verdicts by sentence: one result counts once, and what chance may have decided is said."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest
from hand_made_verdicts import evidence, report, verdict
from hypothesis import given
from hypothesis import strategies as st

from evoclaims.judging.verdict import Outcome
from evoclaims.verdicts.claim_report import CONTROL, Attainable, ClaimReport, Tally
from evoclaims.verdicts.sentences import chance, sentences


def _refuted(claim: str, part: str, line: int, **fields: object) -> ClaimReport:
    judged = verdict("refuted", evidence=(evidence(describe="other"), evidence(describe=part)), deciding=1)
    return report(claim, "refuted", verdict=judged, line=line, asserts=claim, **fields)


def test_a_sentence_with_the_assertion_of_an_earlier_one_counts_once() -> None:
    first, again = report("S8", asserts="same", line=9), report("S4", asserts="same", line=5, case="b")
    found = sentences([first, again, report("C1", asserts="same", where=CONTROL)])
    assert [(one.claim, one.same_as) for one in found] == [("S4", ()), ("S8", ("S4[b]",))]


def test_a_sentence_that_ends_otherwise_than_one_of_its_assertion_counts_by_itself() -> None:
    """Another function under the same name, or a further look: nothing refuted is left out of the count."""
    found = sentences([report("P3", asserts="same", line=1), report("P4", "refuted", asserts="same", line=2)])
    assert [(one.outcome, one.same_as) for one in found] == [(Tally.SUPPORTED, ()), (Tally.REFUTED, ())]


def test_a_sentence_that_the_part_of_an_earlier_one_refutes_counts_once() -> None:
    same, other = _refuted("D4", "x in most trials", 9), _refuted("D5", "y in most trials", 10)
    found = sentences([same, other, _refuted("S7", "x in most trials", 5)])
    assert [(one.claim, one.same_as) for one in found] == [("S7", ()), ("D4", ("S7",)), ("D5", ())]
    supported = [replace(_refuted(name, "x", 5), outcome=Outcome.SUPPORTED) for name in ("S7", "D4")]
    assert [one.same_as for one in sentences(supported)] == [(), ()]  # other parts had to hold as well


def test_one_case_with_a_result_of_its_own_keeps_its_sentence() -> None:
    cases = [report("S8", asserts=name, line=9, case=name) for name in ("same", "own")]
    assert [one.same_as for one in sentences([report("S4", asserts="same", line=5), *cases])] == [(), ()]


@pytest.mark.parametrize(
    ("outcomes", "ends"),
    [
        (("supported", "supported"), Tally.SUPPORTED),
        (("supported", "inconclusive"), Tally.INCONCLUSIVE),
        (("inconclusive", "refuted", "supported"), Tally.REFUTED),
        (("refuted", "error"), Tally.ERROR),
        (("supported", "not run"), Tally.NOT_RUN),
    ],
)
def test_a_sentence_ends_as_its_worst_case(outcomes: Sequence[str], ends: Tally) -> None:
    cases = [report("G1", outcome, case=str(place)) for place, outcome in enumerate(outcomes)]
    assert [one.outcome for one in sentences(cases)] == [ends]


def test_a_sentence_with_a_vacuous_case_is_not_supported() -> None:
    cases = [report("G1", case="a"), report("G1", case="b", satisfied_by=("no action",))]
    assert [one.outcome for one in sentences(cases)] == [Tally.VACUOUS]


def _by_hand(values: Sequence[float], rate: float) -> set[int]:
    """Return the places that Benjamini and Hochberg keep: the k smallest, for the largest k with p_k <= rate k / m."""
    order = sorted(range(len(values)), key=lambda place: values[place])
    kept = [k for k, place in enumerate(order, 1) if values[place] <= rate * k / len(values)]
    return set(order[: max(kept, default=0)])


# Shares of a prime, so that no p lies on a bound, where rounding decides.
P = st.integers(0, 10_007).map(lambda share: share / 10_007)


@given(st.lists(st.tuples(P, P, st.sampled_from(["supported", "refuted"]))))
def test_kept_cases_are_those_of_benjamini_and_hochberg(cases: list[tuple[float, float, str]]) -> None:
    looks = (Attainable(5, 0.01, 0.0, 0.0), Attainable(10, 0.04, 0.0, 0.0))
    reports = [
        report("G1", outcome, verdict=verdict(outcome, p=p, p_refuted=against, alpha=0.04), attainable=looks)
        for p, against, outcome in cases
    ]
    found = chance(reports)
    values = [min(1.0, p * 0.05 / 0.04) for for_, against, _ in cases for p in (for_, against)]
    assert (found.tested, found.expected) == (len(cases), pytest.approx(0.05 * len(cases)))
    for rate, kept in found.kept.items():
        places = _by_hand(values, rate)
        own = [2 * case + (outcome == "refuted") for case, (_, _, outcome) in enumerate(cases)]
        ends = [[place in places for place, one in zip(own, cases, strict=True) if one[2] == end] for end in _ENDS]
        assert kept == tuple(map(sum, ends))


_ENDS = ("supported", "refuted")


def test_controls_and_facts_are_not_tested_by_chance() -> None:
    assert chance([report(where=CONTROL), report(verdict=verdict(p=None))]).tested == 0
