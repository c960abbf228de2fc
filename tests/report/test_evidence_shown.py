"""Parts of a verdict as they are shown: numbers, bounds and values, taken from what the real judge writes."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hand_made_verdicts import evidence, verdict
from laboratory import HERE, Laboratory
from unpacked import whole

from evoclaims.judging.assertion import Assertion
from evoclaims.judging.exact import MAX_TRIALS
from evoclaims.judging.sample import Sample, sample
from evoclaims.judging.verdict import Bound
from evoclaims.report.charts import strip_svg
from evoclaims.report.evidence import Part, judged_parts, unjudged_part
from evoclaims.report.trial_summary import Reader
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
        one = Sample("a: x", tuple(range(n)), values, 0.5, (n - 1,), ("timeout",))
        (shown,) = judged_parts(verdict(evidence=(evidence(samples=(one,)),), deciding=0))
        return shown

    assert part(3).rows == (("0", ("0.5",)), ("1", ("0.5",)), ("2", ("timeout",)))
    assert len(part(MAX_TRIALS).rows) == MAX_TRIALS


def test_trials_of_a_table_are_named_by_its_seeds(lab: Laboratory) -> None:
    """One table has the seeds 1 and 2, another 2 and 3: a row of the report is a row of either, or of both."""
    samples = tuple(
        Sample(f"{name}: x", (0, 1), (0.5, -math.inf), 0.5, (1,), ("diverged",), known_as=known_as)
        for name, known_as in {
            "a": ("0 (1 in the table)", "1 (2 in the table)"),
            "b": ("0 (1 in the table)", "1 (<i>3</i>\n in the table)"),
            "c": (),
        }.items()
    )
    (part,) = judged_parts(verdict(evidence=(evidence(samples=samples),), deciding=0))
    assert part.rows == (
        ("0", ("–", "–", "0.5")),
        ("0 (1 in the table)", ("0.5", "0.5", "–")),
        ("1", ("–", "–", "diverged")),
        ("1 (2 in the table)", ("diverged", "–", "–")),
        ("1 (<i>3</i> in the table)", ("–", "diverged", "–")),
    )
    drawn = [strip_svg(part, strip) for strip in part.strips]
    assert [">seed 0 (1 in the table): 0.5<" in one for one in drawn] == [True, True, False]
    assert ">seed 1 (&lt;i&gt;3&lt;/i&gt; in the table): diverged<" in drawn[1]
    (trial,) = lab.put("better", [0.25], provenance={**HERE, "seed_in_table": "<7>"})
    assert sample("a", [trial], [0.25]).known_as == ("0 (<7> in the table)",)
    alone = unjudged_part("a", Reader(lab.archive).read([trial.id]))
    assert alone.rows == (("0 (<7> in the table)", ("0.25",)),)
    assert ">seed 0 (&lt;7&gt; in the table): 0.25<" in strip_svg(alone, alone.strips[0])


def test_of_several_parts_the_one_that_decided_is_marked(filled: Laboratory) -> None:
    def both(group: Any) -> Assertion:
        above: Assertion = group("better").mean_success > group("worse").mean_success
        return above & group("worse").mean_success.between(0.6, 1.0)

    page = filled.page(filled.judge(both))
    assert [part.decided for part in page.sections[0].parts] == [False, True]
    assert whole(page).count('<span class="tag">decided</span>') == 1
    alone = filled.page(filled.judge(lambda group: group("better").mean_success > group("worse").mean_success))
    assert "decided</span>" not in whole(alone)
