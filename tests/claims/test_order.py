"""The order of claims: an early verdict, no two workers at the same trials, and all done at about the same time."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import chain

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoclaims.claims.workload import Order, Work, Workload
from evoclaims.paper.cost import Cost
from evoclaims.trials.layout import Layout


def load(claims: Mapping[str, str], programs: str = "", **seconds: float) -> Workload:
    """Return claims on conditions of one letter each; those in `programs` share their programs."""
    costs = {name: Cost(0, took, 10, Layout.ALONE) for name, took in seconds.items()}
    works = {
        name: Work(name, "shared" if name in programs else name, 0, ("file",) * (cost.work > 0), cost)
        for name, cost in costs.items()
    }
    return Workload("store", {claim: tuple(needs) for claim, needs in claims.items()}, works)


def given_out(made: Workload, workers: int) -> tuple[list[list[str]], float, float]:
    """Let workers judge claims, two at a time as xdist gives them, and wait for trials that another one runs.

    Returns:
        The claims of each worker, when the last one ends, and how long they waited for each other.
    """
    order, left = Order[int](made, workers), list(made.claims)
    queues: list[list[str]] = [[] for _ in range(workers)]
    claims: list[list[str]] = [[] for _ in range(workers)]
    clocks, waited, there = [0.0] * workers, 0.0, dict[str, float]()
    busy = set(range(workers))
    while busy:
        now = min(busy, key=lambda one: clocks[one])
        while left and len(queues[now]) < 2:
            queues[now].append(order.next(now, left))
            left.remove(queues[now][-1])
        if not queues[now]:
            busy.remove(now)
            continue
        claim = queues[now].pop(0)
        claims[now].append(claim)
        for name in made.claims[claim]:
            if name in there:
                waited += max(there[name] - clocks[now], 0.0)
                clocks[now] = max(there[name], clocks[now])
            else:
                there[name] = clocks[now] = clocks[now] + made.conditions[name].seconds
        order.ended(claim)
    return claims, max(clocks), waited


def test_one_process_judges_the_claims_that_take_the_least_first_and_then_those_whose_trials_are_there() -> None:
    made = load({"long": "l", "both": "ls", "short": "s", "stored": "t", "gap": "", "again": "s"}, l=90, s=5, t=0)
    (claims,), _, _ = given_out(made, 1)
    assert claims == ["stored", "gap", "short", "again", "long", "both"]


def test_workers_have_an_early_verdict_and_begin_with_the_longest_condition_alone() -> None:
    made = load({"all": "abcd", "a": "a", "b": "b", "c": "c", "d": "d", "quick": "q"}, a=10, b=30, c=20, d=50, q=1)
    (one, two), end, _ = given_out(made, 2)
    assert one[0] == "quick"
    assert {one[1], two[0]} == {"d", "b"}
    assert end <= 61  # of 111 seconds of work


def test_claims_that_share_trials_go_to_one_worker_while_others_have_anything_else_to_do() -> None:
    claims = {"x1": "x", "y1": "y", "x2": "x", "y2": "y", "x3": "xw", "y3": "yv", "z": "z", "u": "u"}
    (one, two), end, waited = given_out(load(claims, x=60, y=50, w=5, v=6, z=20, u=30), 2)
    for shared in ({"x1", "x2", "x3"}, {"y1", "y2", "y3"}):
        assert shared <= set(one) or shared <= set(two)
    assert (end, waited) == (86, 0)  # of 171 seconds of work


def test_claims_that_share_programs_go_to_one_worker_unless_another_has_nothing_else_to_do() -> None:
    claims = {"p": "p", "q": "q", "r": "r", "s": "s", "t": "t"}
    together, _, _ = given_out(load(claims, programs="pq", p=50, q=1, r=40, s=8, t=2), 2)
    assert any({"p", "q"} <= set(one) for one in together)
    _, end, _ = given_out(load(claims, programs="pqrst", p=10, q=10, r=10, s=10, t=10), 2)
    assert end <= 30


def test_a_claim_on_trials_that_another_worker_runs_waits_behind_all_others() -> None:
    order = Order[int](load({"x": "x", "both": "xy", "z": "z"}, x=60, y=50, z=1), 2)
    assert order.next(1, ["x"]) == "x"
    assert order.next(2, ["both", "z"]) == "z"
    order.ended("x")
    assert order.next(2, ["both"]) == "both"


def test_another_worker_takes_what_a_dead_one_had_begun() -> None:
    order = Order[int](load({"x": "x", "x2": "x", "y": "y"}, x=60, y=50), 2)
    assert order.next(1, ["x"]) == "x"
    order.lost(1)
    assert order.next(2, ["y", "x2"]) == "x2"


@given(
    st.lists(st.sets(st.sampled_from("abcdefgh"), max_size=3), min_size=1, max_size=20),
    st.lists(st.floats(0.0, 100.0), min_size=8, max_size=8),
    st.integers(1, 4),
)
def test_every_claim_is_given_out_once_and_no_worker_idles_long(
    needs: list[set[str]], seconds: list[float], workers: int
) -> None:
    made = load(
        {str(i): "".join(sorted(one)) for i, one in enumerate(needs)}, **dict(zip("abcdefgh", seconds, strict=True))
    )
    claims, end, _ = given_out(made, workers)
    assert sorted(chain(*claims)) == sorted(made.claims)
    needed = {name for one in needs for name in one}
    assert end <= sum(made.conditions[name].seconds for name in needed) + 1e-6


@pytest.mark.parametrize("workers", [1, 2])
def test_the_same_claims_come_in_the_same_order(workers: int) -> None:
    made = load({str(i): "abcdefgh"[i % 8] for i in range(40)}, **dict.fromkeys("abcdefgh", 1.0))
    assert given_out(made, workers) == given_out(made, workers)
