"""What describes trials beside the tests: interquartile means, and how far one has looked."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
from hand_made_verdicts import evidence, verdict

from evoclaims.judging.sample import Sample
from evoclaims.report.charts import strip_svg
from evoclaims.report.evidence import Part, judged_parts

INF = math.inf


def part_of(*samples: Sample, **changes: Any) -> Part:
    (part,) = judged_parts(verdict(evidence=(evidence(samples=samples, **changes),), deciding=0))
    return part


def sample(label: str, *values: float, limit: float | None = None, median: float | None = None) -> Sample:
    middle = sorted(values)[len(values) // 2] if median is None else median
    return Sample(label, tuple(range(len(values))), values, middle, (), (), limit)


def numbers(part: Part) -> dict[str, str]:
    return dict(part.numbers)


def test_each_condition_has_its_interquartile_mean() -> None:
    part = part_of(sample("a on t: x", 0.0, 1.0, 2.0, 9.0), sample("b on t: x", 3.0, 3.0, 3.0, 3.0))
    assert numbers(part)["IQM of a on t"].startswith("1.5 (95% stratified bootstrap 0")
    assert numbers(part)["IQM of b on t"] == "3 (95% stratified bootstrap 3 to 3)"


def test_levels_of_one_condition_are_told_apart_and_events_have_no_mean() -> None:
    part = part_of(sample("a on t: x at level 0", 0.0, 1.0), sample("a on t: x at level 1", 1.0, 1.0))
    assert {"IQM of a on t: x at level 0", "IQM of a on t: x at level 1"} < set(numbers(part))
    part = part_of(sample("a on t: x", 0.0, 1.0), sample("b on t: x", 1.0, 1.0), events=True)
    assert not any("IQM" in name for name in numbers(part))


@pytest.mark.parametrize(
    ("values", "said", "mean"),
    [
        ((10.0, 20.0, 30.0, INF), "25", "25"),
        ((10.0, 20.0, INF, INF), "> 60", "> 60"),  # the third is above 100, and so the middle above (20 + 100) / 2
        ((10.0, INF, INF, INF), "> 100", "> 100"),
    ],
)
def test_what_is_not_observed_is_said_to_be_more(values: tuple[float, ...], said: str, mean: str) -> None:
    median = (sorted(values)[1] + sorted(values)[2]) / 2
    part = part_of(sample("a on t: x, within 100", *values, limit=100.0, median=median))
    (strip,) = part.strips
    assert strip.middle == said
    assert f"median {said}" in str(strip_svg(part, strip)).replace("&gt;", ">")
    assert dict(strip.apart) == {seed: "> 100" for seed, value in enumerate(values) if value == INF}
    assert numbers(part)["IQM of a on t"].startswith(f"{mean} (95% stratified bootstrap ")
    assert numbers(part)["IQM of a on t"].endswith(", nothing beyond 100)")


def test_a_trial_that_failed_is_no_trial_that_never_got_there() -> None:
    broken = replace(sample("a: x", 1.0, INF, INF, limit=9.0), failed=(2,), endings=("diverged",))
    assert dict(part_of(broken).strips[0].apart) == {1: "> 9", 2: "diverged"}
