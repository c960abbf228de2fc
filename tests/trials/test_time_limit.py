"""A batch whose time is over: what is kept of it, how long that answers, and from where it goes on."""

from __future__ import annotations

import math
import signal
import threading
import weakref
from collections.abc import Callable
from contextlib import nullcontext, suppress
from typing import Any

import pytest
from climbers import CLIMBING, SEEDS, Log, digests, run_climbers
from hypothesis import given
from hypothesis import strategies as st

from evoclaims.core import waiting
from evoclaims.core.errors import UserError
from evoclaims.trials import stopping as allowances
from evoclaims.trials.batches import StoredTrials
from evoclaims.trials.failed import DEFAULT_LIMIT, answers, is_final, seconds_of
from evoclaims.trials.progress import RunProgress
from evoclaims.trials.result import TrialResult
from evoclaims.trials.result_codec import dump
from evoclaims.trials.runner import run
from evoclaims.trials.stopping import Allowance, OutOfTimeError
from evoclaims.trials.store import Store

pytestmark = pytest.mark.oldest

Make = Callable[..., TrialResult]


class Counted(Allowance):
    """Each piece of work costs a second, however long it takes."""

    def spend(self, work: Callable[[], Any]) -> Any:
        if self.left <= 0:
            raise OutOfTimeError
        self.left -= 1
        return work()


def _run(store: Store, cpus: list[Any], limit: float, watch: Any = lambda progress: None) -> list[TrialResult]:
    return run(CLIMBING, SEEDS, store, cpus, watch, time_limit=limit)


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("evoclaims.trials.runner.Allowance", Counted)


def test_a_batch_that_takes_too_long_ends_between_two_calls_and_keeps_what_it_has(
    counted: None, store: Store, cpus: list[Any], uninterrupted: list[TrialResult]
) -> None:
    log = Log()
    results = _run(store, cpus, 4.0, log)  # to begin, and three calls of the device
    late = [result for result in results if result.status == "timeout"]
    assert late
    for result, whole in zip(results, uninterrupted, strict=True):
        if result.status != "timeout":
            assert result.digest == whole.digest
            continue
        steps = result.curves["steps"]
        assert len(steps) > 0
        assert {name: values[: len(steps)] for name, values in whole.curves.items()} == result.curves
        assert (result.levels, result.champion) == ({}, "")
        assert result.metrics["environment_steps"] == result.curves["environment_steps"][-1]
        assert result.timing["limit"] == 4.0
        assert result.id == whole.id
    assert log[-1].phase == "out of time after 4 s"
    assert log[-1].trials == len(late)


def test_what_ran_out_of_time_answers_until_more_is_allowed_and_then_goes_on_where_it_was(
    counted: None, store: Store, cpus: list[Any], uninterrupted: list[TrialResult], monkeypatch: pytest.MonkeyPatch
) -> None:
    first = _run(store, cpus, 4.0)
    with monkeypatch.context() as patch:
        patch.setattr("evoclaims.trials.runner.Lanes", None)
        for limit in (4.0, 1.0):
            assert [*map(dump, _run(store, cpus, limit))] == [*map(dump, first)]
    log = Log()
    assert digests(_run(store, cpus, 40.0, log)) == digests(uninterrupted)
    assert log.phases()[0] == "resuming"
    assert log.steps()[0] > min(max(r.curves["steps"]) for r in first if r.status == "timeout")
    assert not list(store.checkpoints.iterdir())


def test_on_request_it_has_as_much_time_again(
    counted: None, store: Store, cpus: list[Any], uninterrupted: list[TrialResult]
) -> None:
    tries = 0
    while any(result.status == "timeout" for result in _run(store, cpus, 4.0)):
        StoredTrials(store, CLIMBING).forget_timeouts(SEEDS)
        tries += 1
        assert tries < 10
    assert tries > 0
    assert digests(_run(store, cpus, 4.0)) == digests(uninterrupted)


def test_a_batch_that_is_interrupted_again_and_again_has_no_more_time_than_one_that_is_not(
    counted: None, store: Store, cpus: list[Any]
) -> None:
    def interrupted(progress: RunProgress) -> None:
        if progress.phase == "training":
            raise KeyboardInterrupt

    runs, results = 0, list[TrialResult]()
    while not results:
        runs += 1
        with suppress(KeyboardInterrupt):  # each run takes two: to begin, and for a call of the device
            results = run(CLIMBING, SEEDS, store, cpus, interrupted, 0.0, time_limit=7.0)
    assert "timeout" in {result.status for result in results}
    assert runs <= 4


def test_a_batch_that_had_no_time_to_begin_is_stored_without_a_curve(
    store: Store, cpus: list[Any], monkeypatch: pytest.MonkeyPatch, uninterrupted: list[TrialResult]
) -> None:
    class Never(Allowance):
        def spend(self, work: Any) -> Any:
            raise OutOfTimeError

    with monkeypatch.context() as patch:
        patch.setattr("evoclaims.trials.runner.Allowance", Never)
        results = _run(store, cpus, 4.0)
    assert {(r.status, r.metrics["steps"], len(r.curves)) for r in results} == {("timeout", 0.0, 0)}
    assert digests(run_climbers(store, cpus)) == digests(uninterrupted)


@pytest.mark.parametrize("waits", [True, False])
def test_waiting_for_another_process_costs_no_time(waits: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    now, begun, late = 0.0, threading.Event(), threading.Event()

    def look(*_: Any) -> None:
        """Half a second goes by at each look; after 50 of them the work ends."""
        nonlocal now
        begun.wait()
        if (now := now + 0.5) == 25.0:
            late.set()

    monkeypatch.setattr(waiting.time, "monotonic", lambda: now)
    monkeypatch.setattr(allowances, "wait", look)

    def work() -> str:
        with waiting.waiting() if waits else nullcontext():
            begun.set()
            late.wait()
        return "done"

    if waits:
        assert Allowance(5.0).spend(work) == "done"
    else:
        with pytest.raises(OutOfTimeError):
            Allowance(5.0).spend(work)
        late.set()


def test_the_clock_stands_while_any_thread_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 0.0
    monkeypatch.setattr(waiting.time, "monotonic", lambda: now)
    began = waiting.working_time()
    now += 1
    first, second = waiting.waiting(), waiting.waiting()
    first.__enter__()
    now += 10
    second.__enter__()
    now += 10
    assert waiting.working_time() - began == 1
    first.__exit__(None, None, None)
    now += 10
    second.__exit__(None, None, None)
    now += 1
    assert waiting.working_time() - began == 2


def test_with_a_limit_the_work_has_a_thread_of_its_own_and_what_it_raises_is_raised() -> None:
    assert Allowance(math.inf).spend(threading.current_thread) is threading.current_thread()
    assert Allowance(600.0).spend(threading.current_thread).daemon
    for seconds in (math.inf, 600.0):
        with pytest.raises(ZeroDivisionError):
            Allowance(seconds).spend(lambda: 1 // 0)


@pytest.fixture
def ended(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The statuses with which the process would have ended at once, by the work of this test alone."""
    monkeypatch.setattr(allowances, "_working", weakref.WeakSet())
    statuses: list[int] = []
    monkeypatch.setattr("os._exit", statuses.append)
    return statuses


def test_work_that_does_not_return_is_left_behind_and_no_other_is_begun(ended: list[int]) -> None:
    allowance, release = Allowance(0.05), threading.Event()
    with pytest.raises(OutOfTimeError):
        allowance.spend(release.wait)
    with pytest.raises(OutOfTimeError):
        allowance.spend(lambda: pytest.fail("begun without time"))
    (made,) = allowances._working
    allowances.end_without(7)
    release.set()
    made.result(60)
    allowances.end_without(8)
    assert ended == [7]


@pytest.mark.parametrize("where", [(threading.Thread, "start"), (allowances, "wait")], ids=["start", "wait"])
def test_however_often_and_whenever_work_is_interrupted_the_process_does_not_wait_for_it(
    where: tuple[Any, str], ended: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    release, start = threading.Event(), threading.Thread.start

    def interrupted(*arguments: Any) -> None:
        if isinstance(arguments[0], threading.Thread):
            start(arguments[0])
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(*where, interrupted)
        with pytest.raises(KeyboardInterrupt):
            Allowance(600.0).spend(release.wait)
    allowances.end_without(130)
    (made,) = allowances._working
    release.set()
    made.result(60)
    assert ended == [130]


def test_time_in_which_the_process_was_stopped_does_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    stopped, release = iter([0.0, 5_000.0, 5_000.0, 10_000.0]), threading.Event()

    def clock() -> float:
        now = next(stopped, None)
        if now is None:
            release.set()
            return 10_001.0
        return now

    monkeypatch.setattr("evoclaims.core.waiting.time.monotonic", clock)
    monkeypatch.setattr(allowances, "LOOK_SECONDS", 0.01)
    allowance = Allowance(1.0)
    assert allowance.spend(release.wait)
    assert allowance.left > 0.9


@given(st.integers(1, 10**6), st.sampled_from([("s", 1.0), ("min", 60.0), ("h", 3600.0)]), st.sampled_from(["", " "]))
def test_a_time_is_a_number_and_its_unit(number: int, unit: tuple[str, float], space: str) -> None:
    assert seconds_of(f"{number}{space}{unit[0]}") == number * unit[1]
    assert seconds_of(f"{number}.5{space}{unit[0]}") == (number + 0.5) * unit[1]
    assert seconds_of("none") == math.inf
    assert seconds_of(DEFAULT_LIMIT) >= 3600.0


@pytest.mark.parametrize("text", ["", "3", "h", "-1h", "0s", "0.0min", "1e3s", "2 days", "nan h", "1h 30min", "٣h"])
def test_another_text_is_a_sentence(text: str) -> None:
    with pytest.raises(UserError, match='such as "90s", "30min" or "24h", or "none", not'):
        seconds_of(text)


def test_only_a_trial_that_ran_out_of_as_much_time_must_not_be_run(make_result: Make) -> None:
    assert not is_final(None)
    assert not answers(None, math.inf)
    for status in ("done", "diverged"):
        assert answers(make_result(status=status), math.inf)
    late = make_result(status="timeout")
    assert not answers(late, 1.0)  # a record that does not say
    object.__setattr__(late, "timing", {**late.timing, "limit": 60})
    assert [answers(late, limit) for limit in (59.0, 60.0, 61.0, math.inf)] == [True, True, False, False]


@pytest.mark.parametrize(("more", "says"), [(0.2, ""), (0.5, f"{allowances.WAITS}\n")])
def test_an_interrupt_waits_for_the_work_that_is_under_way_and_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], more: float, says: str
) -> None:
    """A real one: what Python makes of it in the waiting thread differs between its versions."""
    monkeypatch.setattr(allowances, "LOOK_SECONDS", 0.1 if says else 30.0)
    done: list[bool] = []

    def work() -> None:
        pause = threading.Event()
        pause.wait(0.2)
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
        done.append(pause.wait(more))

    with pytest.raises(KeyboardInterrupt):
        Allowance(600.0).spend(work)
    assert done
    assert capsys.readouterr().err == says
