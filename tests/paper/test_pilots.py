"""Committed pilots: they keep what claims read and nothing else, and what is not a pilot of a condition is told."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from evoclaims.core.errors import UserError
from evoclaims.judging.design import THREE_LOOKS, Design
from evoclaims.judging.reading import TrialReading
from evoclaims.paper import pilots
from evoclaims.paper.reproduction import Reproduction
from evoclaims.paper.trial_group import TrialGroup
from evoclaims.trials.result import TrialResult
from reproductions.nisioti2025 import REPRODUCTION

SIX = Design.fixed(6)


@pytest.fixture
def group(reproduction: Reproduction) -> TrialGroup:
    """The trials of "better on small"."""
    condition = reproduction.tier("smoke").condition("better", "small")
    return TrialGroup("better", "small", condition, lambda condition, seeds: [])


@pytest.fixture
def readings(group: TrialGroup) -> list[TrialReading]:
    """What two claims read."""
    return [group.mean_success, group.success, group.solves_level(0)]


@pytest.fixture
def trials(group: TrialGroup, made: Callable[..., TrialResult]) -> list[TrialResult]:
    """Seven trials, in no order, one diverged and one without limit, of two revisions."""
    found = [made(group.condition, seed, seed / 106, git={"sha": "a" * 40}) for seed in (102, 100, 101, 103, 104, 105)]
    found[2] = replace(found[2], status="diverged")
    found[3] = replace(found[3], metrics={**found[3].metrics, "mean_success": math.inf})
    return [*found, made(group.condition, 106, 1.0, git={"sha": "b" * 40})]


@pytest.fixture
def path(reproduction: Reproduction) -> Path:
    """Where the pilot of "better on small" belongs."""
    return pilots.path_of(reproduction.folder, "smoke", "better", "small", second=False)


def test_a_pilot_is_read_as_it_was_written_with_what_claims_read(
    path: Path, trials: list[TrialResult], readings: list[TrialReading]
) -> None:
    pilots.write(path, trials, readings)
    back = pilots.load(path)
    assert [trial.seed for trial in back] == [*range(100, 107)]
    for was, now in zip(sorted(trials, key=lambda trial: trial.seed), back, strict=True):
        assert (now.id, now.condition, now.spec) == (was.id, was.condition, was.spec)
        assert (now.status, now.provenance) == (was.status, was.provenance)
        assert [reading.of(now) for reading in readings] == [reading.of(was) for reading in readings]
    assert (back[0].metrics.keys(), back[0].levels.keys()) == ({"mean_success", "furthest_solved"}, {"success"})
    assert (back[1].metrics, back[1].curves) == ({}, {})  # nothing is read from a diverged trial
    assert back[3].metrics["mean_success"] == math.inf
    before = path.read_bytes()
    pilots.write(path, back, readings)
    assert path.read_bytes() == before


def test_a_pilot_takes_a_fraction_of_the_records(
    path: Path, trials: list[TrialResult], readings: list[TrialReading]
) -> None:
    many = [replace(trials[0], seed=seed, spec={**trials[0].spec, "seed": seed}) for seed in range(100, 150)]
    pilots.write(path, many, readings)
    assert path.stat().st_size < 50 * 250
    assert path.read_text().count("\n") == 51


@pytest.mark.parametrize(
    ("was", "now"),
    [
        ('"seed":102', '"seed":107'),
        ('"schema":1', '"schema":2'),
        ('"status":"diverged"', '"status":"lost"'),
        ('"provenance":0', '"provenance":7'),
        ("{", "("),
        ("\n", ""),
    ],
)
def test_a_pilot_that_was_edited_or_torn_is_a_sentence(
    path: Path, trials: list[TrialResult], readings: list[TrialReading], was: str, now: str
) -> None:
    pilots.write(path, trials, readings)
    path.write_text(path.read_text().replace(was, now, 1))
    with pytest.raises(UserError, match="is not a pilot: .* make it anew with `evoclaims power --run`"):
        pilots.load(path)
    path.write_text("")
    with pytest.raises(UserError, match="is not a pilot: Input data was truncated"):
        pilots.load(path)
    path.unlink()
    path.mkdir()
    with pytest.raises(UserError, match="is not a pilot"):
        pilots.load(path)


def test_trials_that_are_no_pilot_of_a_condition_say_why(
    group: TrialGroup, trials: list[TrialResult], readings: list[TrialReading]
) -> None:
    def why(found: list[TrialResult], design: Design = SIX) -> str:
        return pilots.unfit(found, group.condition, design, readings)

    assert why(trials) == ""
    assert "not been made" in why([])
    assert "of another condition" in why([replace(trials[0], condition="f" * 64)])
    assert "seeds of the tier's own trials (100, 101)" in why(trials, replace(SIX, first_seed=96))
    third = Design(looks=THREE_LOOKS[:2], first_seed=80)  # a claim may have a third look, up to seed 109
    assert "seeds of the tier's own trials (100, 101" in why(trials, third)
    assert "5 trials and a verdict looks at 6" in why(trials[:5])
    assert "seeds 102 crashed" in why([replace(trials[0], status="crashed"), *trials[1:]])
    assert "no 'furthest_solved'" in why([replace(trials[0], metrics={"mean_success": 1.0}), *trials[1:]])


def test_new_trials_are_compared_with_those_of_both_pilots(
    path: Path, group: TrialGroup, trials: list[TrialResult], readings: list[TrialReading]
) -> None:
    def both() -> list[int]:
        found = pilots.both(path.parents[2], "smoke", "better", "small", group.condition.id)
        return [trial.seed for trial in found]

    assert (both(), pilots.has_second(path.parents[2], "smoke")) == ([], False)
    pilots.write(path, trials, readings)
    assert (both(), pilots.has_second(path.parents[2], "smoke")) == ([*range(100, 107)], False)
    later = [replace(trials[0], seed=seed, spec={**trials[0].spec, "seed": seed}) for seed in (107, 108)]
    second = pilots.path_of(path.parents[2], "smoke", "better", "small", second=True)
    pilots.write(second, later, readings)
    assert (both(), pilots.has_second(path.parents[2], "smoke")) == ([*range(100, 109)], True)
    assert pilots.not_second(later, trials) == ""
    assert pilots.not_second([*later, trials[0]], trials) == "it has seeds of the first pilot (102)"
    assert pilots.both(path.parents[2], "smoke", "better", "small", "f" * 64) == ()


COMMITTED = sorted(
    path for name in ("pilot", "second_pilot") for path in (REPRODUCTION.folder / name / "smoke").iterdir()
)


@pytest.mark.parametrize("path", COMMITTED, ids=["-".join((path.parts[-3], path.stem)) for path in COMMITTED])
def test_a_committed_pilot_has_fifty_other_seeds_of_todays_condition(path: Path) -> None:
    trials, tier = pilots.load(path), REPRODUCTION.tier("smoke")
    method, _, task = path.stem.partition("-")
    second = path.parts[-3] == "second_pilot"
    assert pilots.path_of(REPRODUCTION.folder, "smoke", method, task, second=second) == path
    assert {trial.condition for trial in trials} == {tier.condition(method, task).id}
    assert {trial.seed for trial in trials} == {*range(150, 200)} if second else {*range(100, 150)}
    assert not {trial.seed for trial in trials} & {*tier.design.seeds(tier.design.last.n)}
