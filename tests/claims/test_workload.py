"""What a run has to do: how far it is, by the store and timings of this machine, and the order of its claims."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_trials import trial_of

from evoclaims.claims.workload import Watching, Work, Workload, remaining, soonest_first
from evoclaims.envs.gates.parity import NParity
from evoclaims.execution.ahead import TierRun
from evoclaims.execution.job import Job
from evoclaims.execution.worker import WorkOrder
from evoclaims.execution.workers import Seat
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.paper.cost import Basis, Cost
from evoclaims.trials.layout import Layout
from evoclaims.trials.lease import Running, announced, shared
from evoclaims.trials.progress import RunProgress
from evoclaims.trials.spec import Budget, Condition
from evoclaims.trials.store import Store

X, Y, Z = "a" * 64, "b" * 64, "c" * 64


@pytest.mark.parametrize(
    ("scale", "now", "left"),
    [
        (1.0, None, 30.0),
        (3.0, None, 90.0),
        (None, None, None),  # other machines alone say nothing about this one
        (1.0, (10.0, None), 20.0),
        (1.0, (40.0, None), 0.0),
        (1.0, (10.0, 77.0), 77.0),  # what runs knows best how fast it is
        (None, (10.0, 77.0), 77.0),
        (None, (10.0, None), None),
    ],
)
def test_what_is_left_of_a_condition(
    scale: float | None, now: tuple[float, float | None] | None, left: float | None
) -> None:
    """`now` is for how long a batch has been running, and what it says itself."""
    batch = now and Running(X, time.time() - now[0], RunProgress("x", "compiling", 10, seconds_left=now[1]))
    found = remaining(30.0, scale, batch)
    assert found == (None if left is None else pytest.approx(left, abs=1.0))


@pytest.fixture
def store(tmp_path: Path) -> Store:
    """An empty store."""
    return Store(tmp_path / "store")


def took(seconds: float, basis: Basis = "here") -> Cost:
    """Return the cost of a batch on an accelerator."""
    return Cost(0.0, seconds, 10, Layout.VECTOR, basis)


def work(name: str, stored: int, *missing: str, cost: Cost) -> Work:
    """Return a method on a task of the same name."""
    return Work((name, name), ("smoke",), "", stored, dict(enumerate(missing)), cost)


def watching(store: Store, workers: int = 2) -> Watching:
    """Watch three claims: on x, of which two trials are stored, on x and y, and on z."""
    works = {
        X: work("x", 2, "x1", "x2", cost=took(40.0)),
        Y: work("y", 0, "y1", "y2", "y3", cost=took(80.0)),
        Z: work("z", 0, "z1", cost=took(10.0)),
    }
    return Watching(Workload(str(store.root), {"one": (X,), "two": (X, Y), "three": (Z,)}, works), workers)


def test_trials_are_counted_as_they_are_stored_and_those_of_judged_claims_are_not_waited_for(store: Store) -> None:
    watched = watching(store)
    seen = watched.look()
    assert (seen.judged, seen.claims, seen.done, seen.trials, seen.running) == (0, 3, 2, 8, [])
    store.root.mkdir()
    (store.root / "x1").touch()
    watched.judged("three")
    seen = watched.look()
    assert (seen.judged, seen.claims, seen.done, seen.trials) == (1, 3, 3, 7)


def test_the_end_is_estimated_from_timings_here_shared_among_the_workers(store: Store) -> None:
    assert watching(store, 1).look().seconds_left == pytest.approx(40 + 80 + 10)
    assert watching(store, 2).look().seconds_left == pytest.approx(80)  # no batch is divided among workers
    watched = watching(store, 2)
    for claim in ("one", "two", "three"):
        watched.judged(claim)
    assert watched.look().seconds_left is None


def test_a_condition_that_ends_tells_how_fast_the_others_will_be_here(store: Store) -> None:
    record = trial_of(Condition(HandBuilt(), NParity(2), "curriculum", Budget(generations=1, reports=1)), 0, 1.0)
    record = replace(record, timing={**record.timing, "compile": 20.0, "run": 40.0})
    assert store.put(record, {}) == "stored"
    (path,) = store.record_paths()
    works = {
        X: work("x", 0, str(path.relative_to(store.root)), cost=took(10.0, "elsewhere")),
        Y: work("y", 0, "y1", cost=took(20.0, "elsewhere")),
    }
    path.rename(store.root / "aside")
    watched = Watching(Workload(str(store.root), {"one": (X,), "two": (Y,)}, works), 1)
    assert watched.look().seconds_left is None
    (store.root / "aside").rename(path)
    assert watched.look().seconds_left == pytest.approx(6 * 20)


def test_what_any_process_runs_is_shown_under_the_name_that_claims_have_for_it(store: Store) -> None:
    with announced(store.root, X), shared(store.root, X, lambda progress: None) as tell:
        tell(RunProgress("hand_built on n_parity", "training", 4, seconds_left=123.0))
        seen = watching(store).look()
        assert [one.progress.condition for one in seen.running] == ["x on x"]
        assert seen.seconds_left == pytest.approx(123)


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
