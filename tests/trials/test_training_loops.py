"""Trials of training loops that are not ours: each in a process of its own, whatever becomes of that."""

from __future__ import annotations

import contextlib
import itertools
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest
import toy_loops
from toy_loops import Nowhere

from evoclaims.core import waiting
from evoclaims.core.errors import UserError
from evoclaims.envs.foreign.gymnasium_task import GymnasiumTask
from evoclaims.envs.gates.parity import NParity
from evoclaims.judging.sample import UnreadableTrialError, checked
from evoclaims.methods.training_loop import TrainingLoop
from evoclaims.trials import failed, loop_examination, loop_trials
from evoclaims.trials.loop_messages import Trained
from evoclaims.trials.loop_process import Reporter, actions_of
from evoclaims.trials.loop_trials import Child, trained_record
from evoclaims.trials.progress import RunProgress
from evoclaims.trials.result import TrialResult
from evoclaims.trials.runner import run
from evoclaims.trials.spec import Budget, Condition, TrialSpec
from evoclaims.trials.store import Store


def condition(function: Any, task: Any = Nowhere(), packages: tuple[str, ...] = (), **settings: Any) -> Condition:  # noqa: B008
    budget = Budget(environment_steps=100, reports=5)
    return Condition(TrainingLoop(function, settings, packages=packages), task, "whole_budget", budget)


IN_EVERY_WAY = condition(toy_loops.in_every_way)


@pytest.fixture(scope="module")
def all_ends(tmp_path_factory: pytest.TempPathFactory, cpus: list[Any]) -> tuple[Store, list[TrialResult], list[Any]]:
    """Trials of a loop that ends in every way, and what was told meanwhile."""
    store, told = Store(tmp_path_factory.mktemp("ends") / "store"), list[RunProgress]()
    return store, run(IN_EVERY_WAY, range(6), store, cpus, told.append), told


def test_each_trial_ends_as_its_process_does_and_the_others_go_on(all_ends: Any) -> None:
    _, results, told = all_ends
    assert [result.status for result in results] == ["done", "crashed", "crashed", "diverged", "diverged", "diverged"]
    good = results[0]
    assert good.metrics["last_fitness"] == 7.5
    assert good.metrics["jax"] == 0.0  # a second of each trial, for loops that do not need it
    assert good.metrics["environment_steps"] == 100
    assert math.isnan(good.metrics["mean_success"])
    assert good.provenance["scored_by"] == "training function"
    assert good.provenance["trained_by"] == "toy_loops:in_every_way"
    assert told[-1].ended == told[-1].trials == 6
    assert told[-1].total_steps == 100


def test_reading_a_number_that_the_loop_has_not_returned_says_so(all_ends: Any) -> None:
    good = checked(all_ends[1][0])
    assert good.metrics["last_fitness"] == 7.5
    loop, trial = "The training loop toy_loops:in_every_way", "the finished trial of seed 0 "
    with pytest.raises(UnreadableTrialError, match=f"^{loop} returned no 'last_success' for {trial}"):
        _ = good.metrics["last_success"]
    with pytest.raises(UnreadableTrialError, match=f"^{loop} returned no policy, .* shows 'success' for {trial}"):
        _ = good.levels["success"]


@pytest.mark.parametrize(
    ("returned", "furthest"),
    [
        ({}, math.nan),
        ({"last_success": 0.5}, math.nan),  # of the first level nothing is known
        ({"last_success": 1.0}, 1.0),
        ({"last_success": 0.5, "furthest_solved": 0.0}, 0.0),
    ],
)
def test_without_a_policy_no_level_counts_as_unsolved_that_nobody_has_examined(
    returned: dict[str, float], furthest: float, cpus: list[Any]
) -> None:
    of_two_levels = condition(toy_loops.in_every_way, NParity(3))
    loop = of_two_levels.loop
    assert loop is not None
    trial = trained_record(TrialSpec(of_two_levels, 0), loop, Trained(returned, None, None), {}, {}, cpus)
    assert trial.metrics["furthest_solved"] == pytest.approx(furthest, nan_ok=True)


def test_what_is_reported_becomes_curves_of_as_many_points_as_the_budget_says(all_ends: Any) -> None:
    _, (good, crashed, *_), _ = all_ends
    steps = (0.0, 20.0, 40.0, 60.0, 80.0, 100.0)
    assert good.curves["environment_steps"] == good.curves["steps"] == steps
    assert good.curves["fitness"] == tuple(step / 100 for step in steps)
    assert crashed.curves["fitness"] == tuple(1 + step / 100 for step in steps)
    assert all(map(math.isfinite, all_ends[1][4].curves["fitness"]))  # it has diverged by what no point shows


def test_a_crash_tells_the_last_words_of_its_process_safely_and_a_divergence_its_number(all_ends: Any) -> None:
    _, (_, raised, killed, *_), told = all_ends
    assert failed.why(raised) == "ValueError: the reactor is \\x1b[31mred"
    assert "in in_every_way" in raised.provenance["crash"]
    lines = Path(str(toy_loops.__file__)).read_text().splitlines()
    (line,) = (number for number, text in enumerate(lines, start=1) if "the reactor is" in text)
    assert failed.place([killed, raised]) == f" (toy_loops.py, line {line})"
    assert failed.place([killed]) == ""
    assert failed.why(killed) == "its process ended with SIGSEGV"
    assert "what it prints is no answer" in killed.provenance["crash"]
    assert {one.phase for one in told if one.remark} == {
        *(f"seed {one.seed} crashed: {failed.why(one)}" for one in (raised, killed)),
        "seed 3 diverged: its function returned last_fitness = nan",
        "seed 4 diverged: its function reported a number that is not finite",
        "seed 5 diverged: its function returned last_fitness = inf",
    }


def test_the_same_seed_gives_the_same_digest_and_another_process_tries_a_crash_again(
    all_ends: Any, store: Store, cpus: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    first, results, _ = all_ends
    run(IN_EVERY_WAY, range(1), store, cpus)
    assert store.get(results[0].id).digest == results[0].digest  # type: ignore[union-attr]
    told = list[RunProgress]()
    run(IN_EVERY_WAY, range(5), first, cpus, told.append)
    assert told == []
    monkeypatch.setattr(failed, "_seen", set())  # as another process has it
    run(IN_EVERY_WAY, range(5), first, cpus, told.append)
    assert {one.trials for one in told if not one.remark} == {2}


def test_a_loop_may_fork_and_what_it_has_forked_ends_with_it(store: Store, cpus: list[Any]) -> None:
    forked, killed = run(condition(toy_loops.with_processes), range(2), store, cpus, time_limit=30.0)
    assert (forked.status, forked.metrics["last_fitness"]) == ("done", 1.0)
    assert (killed.status, failed.why(killed)) == ("crashed", "its process ended with SIGKILL")


def test_what_a_loop_does_in_an_odd_way_is_understood_or_is_a_crash_that_says_what_it_was(
    tmp_path: Path, store: Store, cpus: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "traceback.py").write_text("raise SystemExit('a file where a loop is started is no module')")
    monkeypatch.chdir(tmp_path)
    held: list[int] = []
    close = Child.close

    def noted(self: Child) -> str:
        reason = close(self)
        held.append(len(self._printed))
        return reason

    monkeypatch.setattr(Child, "close", noted)
    odd = condition(toy_loops.in_odd_ways, clip=math.inf)
    good, *crashed = run(odd, range(6), store, cpus, time_limit=30.0)
    assert (good.metrics["last_fitness"], good.metrics["unbounded"]) == (0.25, 1.0)
    assert good.metrics["environment_steps"] == 55
    assert [one.status for one in crashed] == ["crashed"] * 5
    too_far, long, unnamed, reading, loud = map(failed.why, crashed)
    assert too_far.endswith(f"A training function reports {2**60} steps. Report a number from 0 to {2**53}.")
    assert long == "ValueError: " + "x" * 488
    assert unnamed == r"A training loop's metrics are numbers by name, and 'a name that is no \udc80 text' is 1.0."
    told = crashed[0].provenance["crash"]
    assert "in in_odd_ways" in told
    assert "loop_process.py" not in told
    assert reading == "EOFError: EOF when reading a line"
    assert loud == "its process ended with status 3"
    assert crashed[-1].provenance["crash"].endswith("the end\nits process ended with status 3")
    assert max(held) == 2**16  # of five megabytes


@pytest.mark.parametrize("name", ["mean_success", "last_success"])
def test_a_success_that_is_no_share_is_a_crash_that_says_so(store: Store, cpus: list[Any], name: str) -> None:
    share = "A success is a share from 0 to 1, and a level is solved at exactly 1"
    returned, reported = map(failed.why, run(condition(toy_loops.in_points, **{name: 3.0}), range(2), store, cpus))
    assert f"A training loop reports a {name} of 3. {share}: return such a share" in returned
    assert f"A training loop reports a success of 3. {share}: report such a share" in reported
    for fine in (1.0, 1.0 + 1e-7, 0.0):
        (good,) = run(condition(toy_loops.in_points, **{name: fine, "return": 3.0}), range(1), store, cpus)
        assert (good.status, good.metrics[name], good.metrics["return"]) == ("done", fine, 3.0)


def test_a_report_is_checked_however_soon_it_comes_after_another() -> None:
    """A counter that begins again in each epoch would hide what training has spent."""
    report = Reporter(100, lambda answer: None)
    report(0, success=0.5)
    with pytest.raises(UserError, match="A training loop reports a success of 7"):
        report(1, success=7)
    for step in (5, 5, 250):
        report(step)
    with pytest.raises(UserError, match="reports step 3 after step 250. Report the steps since training began"):
        report(3)
    with pytest.raises(UserError, match=r"reports 250\.5 steps. Report a whole number"):
        report(250.5)  # type: ignore[arg-type]
    report(np.float32(250.0))  # type: ignore[arg-type]
    assert report.last == 250


@pytest.mark.parametrize("budget", [Budget(environment_steps=100), Budget(generations=100)])
def test_a_loop_that_returns_fewer_steps_than_it_reported_is_a_crash_that_says_so(
    store: Store, cpus: list[Any], budget: Budget
) -> None:
    counting = replace(condition(toy_loops.counts_less), budget=budget)
    less, as_many = run(counting, range(2), store, cpus)
    assert (less.status, as_many.status, as_many.metrics["steps"]) == ("crashed", "done", 50)
    assert "steps and has reported 50. Return all that it has made, or leave the metric out" in failed.why(less)


def test_threads_of_a_loop_report_without_mixing_their_lines(store: Store, cpus: list[Any]) -> None:
    (told,) = run(condition(toy_loops.from_threads), [0], store, cpus)
    assert told.status == "done"
    assert told.curves["number 699"][-1] == 699.0


def test_a_policy_is_examined_as_all_are_be_it_of_numpy_or_of_jax(store: Store, cpus: list[Any]) -> None:
    right, wrong, again = run(condition(toy_loops.knows_parity, NParity(3)), range(3), store, cpus)
    assert right.provenance["returned"] == again.provenance["returned"] != wrong.provenance["returned"]
    assert right.levels["success"] == (1.0, 1.0)
    assert right.metrics["furthest_solved"] == 1.0
    assert right.metrics["rows"] == 8.0
    assert right.provenance["scored_by"] == "examination"
    assert wrong.levels["success"] == (0.5, 0.5)
    assert wrong.metrics["last_success"] == 0.5  # whatever the function has claimed
    assert wrong.metrics["furthest_solved"] == -1.0
    (table,) = run(condition(toy_loops.knows_by_text, NParity(3)), [0], store, cpus)
    assert table.levels["success"] == (1.0, 1.0)  # no text of a traced observation is in it


@pytest.mark.parametrize("how", ["catches an error", "asks for a type"])
def test_a_policy_that_acts_otherwise_while_jax_traces_it_is_examined_as_it_acts(how: str) -> None:
    task = NParity(3)
    table = {tuple(row > 0): right for row, right in zip(task.table.inputs, task.table.targets, strict=True)}

    def policy(seen: Any) -> Any:
        if how == "asks for a type" and not isinstance(seen, np.ndarray):
            return -seen[:1]
        try:
            return 2.0 * np.asarray(table[tuple(np.asarray(seen) > 0)], np.float32) - 1.0
        except jax.errors.JAXTypeError:
            return -seen[:1]

    assert loop_examination.examined(task, policy, 0).success == (1.0, 1.0)


def _is_alive(pid: int) -> bool:
    """Whether a process is there, and no zombie that nobody has waited for."""
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    return False


def _wait_until_gone(pids: list[int]) -> None:
    """Wait for the end of processes; a test that waits in vain fails."""
    for _ in range(600):
        if not any(map(_is_alive, pids)):
            return
        time.sleep(0.1)
    pytest.fail(f"still there: {[pid for pid in pids if _is_alive(pid)]}")


def test_a_loop_that_never_returns_is_out_of_time_with_its_curves_until_it_is_allowed_more(
    tmp_path: Path, store: Store, cpus: list[Any]
) -> None:
    endless = condition(toy_loops.never_returns, file=str(tmp_path / "pids"))
    (late,) = run(endless, [0], store, cpus, time_limit=3.0)
    assert (late.status, late.curves["fitness"], late.timing["limit"]) == ("timeout", (3.0,), 3.0)
    _wait_until_gone([int(pid) for pid in (tmp_path / "pids").read_text().split()])
    (tmp_path / "pids").unlink()
    run(endless, [0], store, cpus, time_limit=2.0)
    assert not (tmp_path / "pids").exists()
    (again,) = run(endless, [0], store, cpus, time_limit=3.5)
    assert again.timing["limit"] == 3.5


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="whether a process lives is read from /proc")
def test_a_killed_parent_leaves_no_process_behind(tmp_path: Path) -> None:
    script = f"""
import jax
from pathlib import Path
from test_training_loops import condition, run, Store, toy_loops
run(condition(toy_loops.never_returns, file={str(tmp_path / "pids")!r}), [0], Store(Path({str(tmp_path / "store")!r})),
    jax.devices("cpu"))
"""
    path = os.pathsep.join([str(Path(__file__).parent), *sys.path])
    parent = subprocess.Popen([sys.executable, "-c", script], env={**os.environ, "PYTHONPATH": path})
    try:
        for _ in range(1200):
            if (tmp_path / "pids").exists() and len((tmp_path / "pids").read_text().split()) == 3:
                break
            assert parent.poll() is None
            time.sleep(0.1)
        pids = [int(pid) for pid in (tmp_path / "pids").read_text().split()]
        assert all(map(_is_alive, pids))
    finally:
        parent.send_signal(signal.SIGKILL)
        parent.wait()
    _wait_until_gone(pids)


def test_an_interrupted_run_goes_on_with_the_trials_that_it_lacks(
    tmp_path: Path, store: Store, cpus: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("evoclaims.trials.layout.usable_cores", lambda: 1)
    begun = tmp_path / "begun"
    noting = condition(toy_loops.notes, file=str(begun))

    def stop(progress: RunProgress) -> None:
        if progress.ended == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(noting, range(5), store, cpus, stop)
    kept = [seed for seed in range(5) if store.get(TrialSpec(noting, seed).id) is not None]
    assert kept == [0, 1]
    begun.write_text("")
    assert [result.status for result in run(noting, range(5), store, cpus)] == ["done"] * 5
    assert sorted(begun.read_text().split()) == ["2", "3", "4"]


def test_another_version_of_a_declared_package_runs_it_again_unless_any_version_will_do(
    tmp_path: Path, store: Store, cpus: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    noting = condition(toy_loops.notes, packages=("pytest",), file=str(tmp_path / "begun"))
    (made,) = run(noting, [0], store, cpus)
    assert made.provenance["versions"]["pytest"] == pytest.__version__
    monkeypatch.setattr("evoclaims.core.packages.version_of", lambda name: None)
    assert run(noting, [0], store, cpus, any_version=True) == [made]
    for seeds, any_version in (([0], False), ([0, 1], True)):
        with pytest.raises(UserError, match="needs pytest, which is not installed. Install it: pip install pytest"):
            run(noting, seeds, store, cpus, any_version=any_version)
    monkeypatch.setattr("evoclaims.core.packages.version_of", lambda name: "2.0")
    run(noting, [0], store, cpus)
    assert (tmp_path / "begun").read_text().split() == ["0", "0"]


def test_policies_are_told_from_each_other_by_their_actions_on_fixed_starts() -> None:
    """Whatever the seeds of their examinations are, and where a policy knows some observations alone."""

    def table(seen: Any) -> int:
        return {0: 1}[int(seen[0] > 10)]

    def limited(seen: Any) -> int:
        return {True: 0}[bool(seen[2] < 0.05)]

    for task in (GymnasiumTask("CartPole-v1"), NParity(3)):
        found = [actions_of(task, policy) for policy in (table, table, limited, lambda seen: 0)]
        assert found[0] == found[1]
        assert len({hashed for hashed, _ in found}) == 3
        assert not any(graded for _, graded in found)
    assert actions_of(NParity(3), lambda bits: [0.25])[1]


@pytest.mark.parametrize("task", [GymnasiumTask("CartPole-v1"), NParity(3)], ids=["foreign", "built in"])
def test_a_policy_that_draws_or_remembers_is_refused(task: Any) -> None:
    """One that acts a bit differently, as sums on other threads do, is not."""
    random, calls = np.random.default_rng(0), itertools.count()
    for policy in (lambda seen: int(random.integers(2)), lambda seen: next(calls) % 3 % 2):
        with pytest.raises(UserError, match="on the same observation. It must be a function of the observation alone"):
            actions_of(task, policy)
    assert actions_of(NParity(3), lambda seen: [0.5 + 1e-6 * random.random()])[1]


def test_a_loops_wait_for_a_kernel_stops_its_clock(
    store: Store, cpus: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    clock: list[float] = []

    @contextlib.contextmanager
    def noted() -> Iterator[None]:
        with waiting.waiting():
            clock.append(waiting.working_time())
            yield
            clock.append(waiting.working_time())

    monkeypatch.setattr(loop_trials, "waiting", noted)
    for seed, end in ((0, "done"), (1, "crashed")):
        (result,) = run(condition(toy_loops.waits), [seed], store, cpus, time_limit=600.0)
        before, after = clock
        assert (result.status, before) == (end, after)
        began = waiting.working_time()
        assert began > after  # it runs on, also where the process died meanwhile
        del clock[:]
