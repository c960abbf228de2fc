"""Goalposts do not move silently: whatever is fixed beforehand is in the fingerprint."""

from __future__ import annotations

from dataclasses import replace

import pytest

from evoclaims.judging.design import FIXED_10, Look
from evoclaims.judging.judge import fingerprint, judge
from evoclaims.judging.window import Window

FROM_BEFORE = "c3a335c335a9080bc0dd65636a262ed43122812345414ea605ab3b69636d6de5"
"""Of a claim under the first rules: a change of it would start new histories everywhere."""


def test_everything_that_decides_is_in_the_fingerprint(source) -> None:
    a, b = source("a", []), source("b", [])
    greater = a.score() > b.score()
    prints = [
        fingerprint(greater, FIXED_10, claim="G1", tier="full"),
        fingerprint(greater, FIXED_10, claim="G2", tier="full"),
        fingerprint(greater, FIXED_10, claim="G1", tier="smoke"),
        *(
            fingerprint(greater, replace(FIXED_10, **change), claim="G1", tier="full")
            for change in (
                {"looks": (Look(9, 0.05),)},
                {"looks": (Look(10, 0.04),)},
                {"p0": 0.6},
                {"a12_margin": 0.6},
                {"first_seed": 1},
            )
        ),
        *(
            fingerprint(assertion, FIXED_10, claim="G1", tier="full")
            for assertion in (
                b.score() > a.score(),
                a.score("lower") > b.score("lower"),
                a.success(3).at(1) > b.success(3).at(1),
                a.score() > source("c", []).score(),
                a.score() > 1,
                a.score() < 1,
                a.score() > 2,
                a.score() * 2 > b.score(),
                a.score() * 2.0000001 > b.score(),
                a.score() > b.score() * 2,
                a.score("lower").seen_through(Window(10.0)) > b.score("lower").seen_through(Window(10.0)),
                a.score("lower").seen_through(Window(9.0)) > b.score("lower").seen_through(Window(9.0)),
                a.score("lower").seen_through(Window(10.0, 5.0)) > b.score("lower").seen_through(Window(10.0, 5.0)),
                a.score().between(1, 2),
                a.score().between(1, 3),
                a.score().between(0, 2),
                a.score().equivalent_to(b.score(), margin=1.0),
                a.score().equivalent_to(b.score(), margin=2.0),
                a.score().never_above_itself(),
                a.solved().in_most_trials(),
                a.solved().in_most_trials(p0=0.5),
                a.solved().stays(),
                a.solved().in_every_trial(),
                a.success(3).falls(),
                a.success(3).rises(),
                a.success(4).falls(),
                a.solved().stays() & a.success(3).falls(),
                a.solved().stays() | a.success(3).falls(),
            )
        ),
    ]
    assert len(set(prints)) == len(prints)


def test_the_trials_themselves_are_not_in_the_fingerprint(source) -> None:
    prints = {
        judge(source("a", [value] * 10).solved().stays(), FIXED_10, claim="G1", tier="full").fingerprint
        for value in (0.0, 1.0, "crashed")
    }
    assert prints == {fingerprint(source("a", []).solved().stays(), FIXED_10, claim="G1", tier="full")}


def test_the_judging_revision_is_in_the_fingerprint(source, monkeypatch: pytest.MonkeyPatch) -> None:
    import importlib

    module = importlib.import_module("evoclaims.judging.judge")
    assertion = source("a", []).solved().stays()
    before = fingerprint(assertion, FIXED_10)
    monkeypatch.setattr(module, "JUDGING_REVISION", module.JUDGING_REVISION + 1)
    assert fingerprint(assertion, FIXED_10) != before


def test_the_fingerprints_of_claims_made_before_are_what_they_were(source) -> None:
    a, b = source("a", []), source("b", [])
    assert (a.score() > b.score()).plain() == {
        "kind": "greater",
        "above": {"condition": "id of a", "name": "score", "better": "higher"},
        "below": {"condition": "id of b", "name": "score", "better": "higher"},
    }
    joined = a.score().between(1, 2) & a.solved().stays() | a.success(3).falls()
    assert fingerprint(joined, FIXED_10, claim="G1", tier="full") == FROM_BEFORE
