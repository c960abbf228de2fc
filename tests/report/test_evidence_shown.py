"""Parts of a verdict as they are shown: numbers, bounds and values, taken from what the real judge writes."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hand_made_verdicts import evidence, verdict
from laboratory import Laboratory
from unpacked import whole

from evoclaims.judging.assertion import Assertion
from evoclaims.judging.exact import MAX_TRIALS
from evoclaims.judging.sample import Sample
from evoclaims.judging.verdict import Bound
from evoclaims.report.evidence import Part, judged_parts
from evoclaims.verdicts.claim_report import ClaimReport


@pytest.fixture
def shown(filled: Laboratory) -> Any:
    """A function that returns the one part of a claim about the better method."""

    def part(assert_: Any) -> Part:
        (found,) = filled.section(filled.judge(lambda group: assert_(group("better")))).parts
        return found

    return part


def test_a_band_shows_its_ends_and_the_interval_of_the_median(shown: Any) -> None:
    part = shown(lambda group: group.mean_success.between(0.25, 0.75))
    assert part.bounds == (Bound("lowest", 0.25), Bound("highest", 0.75))
    assert [span.of for span in part.spans] == ["median, 95% percentile bootstrap"]
    assert part.event is False


def test_an_event_shows_the_probability_that_it_is_held_against(shown: Any) -> None:
    part = shown(lambda group: group.solves_every_level.in_most_trials(0.7))
    assert part.bounds == (Bound("p0", 0.7),)
    assert part.event is True
    assert [span.of for span in part.spans] == ["P(event), Clopper-Pearson, each end at 0.05"]


def test_a_control_without_chance_has_no_bounds_and_no_p(shown: Any) -> None:
    part = shown(lambda group: group.success_everywhere_is(1.0).in_every_trial())
    assert (part.event, part.bounds) == (True, ())
    assert "p for" not in dict(part.numbers)
    assert part.detail == "does not hold for seeds 1, 2, 3, 4, 5"


def test_a_trend_shows_one_strip_a_level(shown: Any) -> None:
    part = shown(lambda group: group.success.falls())
    assert [strip.label[-7:] for strip in part.strips] == ["level 0", "level 1"]


def test_numbers_stand_with_what_was_attainable(filled: Laboratory) -> None:
    report = filled.judge(lambda group: group("better").mean_success > group("worse").mean_success)
    numbers = dict(filled.section(report).parts[0].numbers)
    assert numbers["p for"] == "0.0011 (smallest attainable 0.0011)"
    assert (numbers["A12"], numbers["Cliff’s δ"], numbers["n a side"]) == ("1", "1", "6")
    assert (numbers["A12, 95% percentile bootstrap"], numbers["A12 margin"]) == ("1 to 1", "0.71")


def test_of_a_refuted_part_the_p_against_it_comes_first(filled: Laboratory) -> None:
    def names(report: ClaimReport) -> list[str]:
        return [name for name, _ in filled.section(report).parts[0].numbers if name.startswith("p ")]

    assert names(filled.judge(lambda group: group("worse").mean_success > group("better").mean_success)) == [
        "p against",
        "p for",
        "p against its size",
    ]
    assert names(filled.judge(lambda group: group("better").mean_success > group("worse").mean_success)) == [
        "p for",
        "p against",
        "p against its size",
    ]


def test_values_are_written_out_by_seed() -> None:
    def part(n: int) -> Part:
        values = (*[0.5] * (n - 1), -math.inf)
        sample = Sample("a: x", tuple(range(n)), values, 0.5, (n - 1,), ("timeout",))
        (shown,) = judged_parts(verdict(evidence=(evidence(samples=(sample,)),), deciding=0))
        return shown

    assert part(3).rows == ((0, ("0.5",)), (1, ("0.5",)), (2, ("timeout",)))
    assert len(part(MAX_TRIALS).rows) == MAX_TRIALS


def test_of_several_parts_the_one_that_decided_is_marked(filled: Laboratory) -> None:
    def both(group: Any) -> Assertion:
        above: Assertion = group("better").mean_success > group("worse").mean_success
        return above & group("worse").mean_success.between(0.6, 1.0)

    page = filled.page(filled.judge(both))
    assert [part.decided for part in page.sections[0].parts] == [False, True]
    assert whole(page).count('<span class="tag">decided</span>') == 1
    alone = filled.page(filled.judge(lambda group: group("better").mean_success > group("worse").mean_success))
    assert "decided</span>" not in whole(alone)
