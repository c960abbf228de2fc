"""The order of claims: an early verdict, and each claim soon after its trials are there."""

from __future__ import annotations

from collections.abc import Mapping

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoclaims.claims.workload import Work, Workload, soonest_first
from evoclaims.execution.ahead import TierRun
from evoclaims.execution.job import Job
from evoclaims.execution.worker import WorkOrder
from evoclaims.execution.workers import Seat
from evoclaims.paper.cost import Cost
from evoclaims.trials.layout import Layout


def load(claims: Mapping[str, str], **seconds: float) -> Workload:
    """Return claims on conditions of one letter each."""
    costs = {name: Cost(0, took, 10, Layout.ALONE) for name, took in seconds.items()}
    works = {
        name: Work((name, "task"), ("smoke",), name, 0, {0: "file"} if cost.work else {}, cost)
        for name, cost in costs.items()
    }
    return Workload("store", {claim: tuple(needs) for claim, needs in claims.items()}, works)


def test_the_claims_that_take_the_least_come_first_and_then_those_whose_trials_are_there() -> None:
    made = load({"long": "l", "both": "ls", "gap": "", "short": "s", "stored": "t", "again": "s"}, l=90, s=5, t=0)
    assert soonest_first(made) == ["stored", "gap", "short", "again", "long", "both"]


@given(
    st.lists(st.sets(st.sampled_from("abcdefgh"), max_size=3), min_size=1, max_size=20),
    st.lists(st.floats(0.0, 100.0), min_size=8, max_size=8),
)
def test_every_claim_comes_once_and_always_at_the_same_place(needs: list[set[str]], seconds: list[float]) -> None:
    claims = {str(i): "".join(sorted(one)) for i, one in enumerate(needs)}
    made = load(claims, **dict(zip("abcdefgh", seconds, strict=True)))
    ordered = soonest_first(made)
    assert sorted(ordered) == sorted(claims)
    assert soonest_first(made) == ordered


def test_several_processes_take_the_next_of_the_queue_when_they_are_free() -> None:
    jobs = {name: Job("", name, "task", (0,)) for name in "abcd"}
    groups = [[jobs["a"]], [jobs["b"], jobs["c"]], [jobs["d"]]]
    order = WorkOrder("store", "smoke", "cpu", 0, 1)
    run = TierRun(order, [Seat(), Seat()], groups, {job: name for name, job in jobs.items()})
    ends = run.ends(load({}, a=10, b=2, c=3, d=4), began=100.0)
    assert ends == pytest.approx({"a": 110, "b": 102, "c": 105, "d": 109})
