"""`--numprocesses N`: the longest batch first, nothing lost and nothing twice, whatever processes die of."""

from __future__ import annotations

import heapq
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tiny_project import REPRODUCTION, Evoclaims, Project

from evoclaims.core.errors import UserError
from evoclaims.envs.gates.parity import NParity
from evoclaims.execution import host as gpus
from evoclaims.execution import workers
from evoclaims.execution.host import AUTO, Host, host_of
from evoclaims.execution.job import Job, MissingBatch
from evoclaims.execution.worker import Ended, WorkOrder
from evoclaims.execution.workers import ATTEMPTS, Seat, Workers, in_queue, seats_of, useful_processes
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.paper.cost import Cost
from evoclaims.trials.integrity import verify
from evoclaims.trials.layout import Layout
from evoclaims.trials.spec import Budget, Condition
from evoclaims.trials.store import Store

ORDER = WorkOrder("store", "smoke", "cpu", 0, 10)


def _batch(name: str, work: float, compile_seconds: float = 0.0, layout: Layout = Layout.VECTOR) -> MissingBatch:
    return MissingBatch(Job("", name, "parity"), tuple(range(10)), Cost(compile_seconds, work, 10, layout))


def _conditions(batches: Sequence[MissingBatch], alike: bool = False) -> dict[tuple[str, str], Condition]:
    """Return a condition for each batch; none shares programs with another unless they are `alike`."""
    return {
        batch.job.names: Condition(HandBuilt(), NParity(2), "curriculum", Budget(generations=1 if alike else i + 1))
        for i, batch in enumerate(batches)
    }


works = st.lists(st.floats(0.1, 100), min_size=1, max_size=40)


@given(works, st.integers(1, 8), st.booleans())
def test_the_longest_comes_first_and_each_once(took: list[float], processes: int, alike: bool) -> None:
    batches = [_batch(str(number), work) for number, work in enumerate(took)]
    seconds = {batch.job: batch.cost.seconds() for batch in batches}
    groups = in_queue(batches, _conditions(batches, alike), processes)
    totals = [sum(seconds[job] for job in group) for group in groups]
    assert totals == sorted(totals, reverse=True)
    assert Counter(job for group in groups for job in group) == Counter(list(seconds))
    assert all(
        total <= sum(took) / processes / 8 for group, total in zip(groups, totals, strict=True) if len(group) > 1
    )


@settings(max_examples=20)
@given(st.lists(st.floats(0.5, 10), min_size=100, max_size=100), st.booleans())
def test_four_workers_end_a_hundred_small_batches_within_15_percent_of_their_share(
    took: list[float], alike: bool
) -> None:
    """Each takes the next of the queue when it is free; batches take as long as estimated."""
    batches = [_batch(str(number), work) for number, work in enumerate(took)]
    seconds = {batch.job: batch.cost.seconds() for batch in batches}
    free = [0.0] * 4
    for group in in_queue(batches, _conditions(batches, alike), 4):
        heapq.heapreplace(free, free[0] + sum(seconds[job] for job in group))
    assert max(free) <= 1.15 * sum(took) / 4


@dataclass(eq=False)
class FakeProcess:
    """A process that dies of some conditions some times, or of being started."""

    order: WorkOrder
    environment: dict[str, str]
    log: list[tuple[str, str]]
    deadly: Counter[str]
    broken: frozenset[str]
    took: Callable[[], None] = field(default=lambda: None)

    @property
    def place(self) -> str:
        return self.environment.get(gpus.VISIBLE, "")

    def is_ready(self) -> bool:
        return self.place not in self.broken

    def run(self, job: Job, tell: Callable[[str], None]) -> Ended | None:
        tell(f"{job.label}: training")
        self.took()
        self.log.append((self.place, job.method))
        if self.deadly[job.method] > 0:
            self.deadly[job.method] -= 1
            return None
        return Ended(job)

    def why(self) -> str:
        return "status 7"

    def close(self) -> None:
        pass

    def stop(self) -> None:
        pass


Run = Callable[..., tuple[list[Ended], list[tuple[str, str]]]]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch) -> Run:
    """A function that runs groups of conditions in fake processes; it returns how they ended, and who ran them."""

    def started(
        groups: Sequence[Sequence[str]],
        places: Sequence[Seat] = (Seat(),),
        deadly: Counter[str] | None = None,
        broken: frozenset[str] = frozenset(),
        took: Callable[[], None] = lambda: None,
    ) -> tuple[list[Ended], list[tuple[str, str]]]:
        log: list[tuple[str, str]] = []
        deaths = Counter(deadly or {})

        def process(order: WorkOrder, environment: dict[str, str]) -> FakeProcess:
            return FakeProcess(order, environment, log, deaths, broken, took)

        monkeypatch.setattr(workers, "Process", process)
        named = [[name.partition(" on ") for name in group] for group in groups]
        asked = [[Job("", method, task or "parity") for method, _, task in group] for group in named]
        return list(Workers(ORDER, places, lambda text: None).run(asked)), log

    return started


def _gpu(name: str) -> Seat:
    return Seat(gpus.seeing_only([name]))


def test_a_process_that_dies_gives_back_what_it_has_not_run(run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    ended, log = run([["a", "b", "c"], ["d"]], deadly=Counter(b=1))
    assert [(one.job.method, one.error) for one in ended] == [("a", ""), ("b", ""), ("c", ""), ("d", "")]
    assert [name for _, name in log] == ["a", "b", "b", "c", "d"]
    assert "evoclaims: b on parity: its process died (status 7); it is begun again." in capsys.readouterr().err


def test_a_condition_that_every_process_dies_of_has_failed_and_the_rest_is_done(run: Run) -> None:
    ended, log = run([["a", "b", "c"], ["d"]], deadly=Counter(b=99))
    assert [(one.job.method, one.error) for one in ended if one.error] == [
        ("b", "its process died (status 7), 3 times")
    ]
    assert sorted(one.job.method for one in ended) == ["a", "b", "c", "d"]
    assert Counter(name for _, name in log) == Counter(a=1, b=ATTEMPTS, c=1, d=1)


def test_a_process_goes_on_with_the_task_that_it_has_traced_if_others_are_hardly_longer(run: Run) -> None:
    """Not with one of many places later: the longest come first, so that the last end at about the same time."""
    _, log = run([[f"{name} on {task}"] for name, task in zip("abcdefghij", "xyxstuvwzx", strict=True)])
    assert "".join(name for _, name in log) == "acbdefghij"


def test_a_gpu_where_no_process_starts_costs_no_condition(run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    ended, log = run([[name] for name in "abcdef"], [_gpu("0"), _gpu("1")], broken=frozenset({"1"}))
    assert {one.job.method: one.error for one in ended} == dict.fromkeys("abcdef", "")
    assert {place for place, _ in log} == {"0"}
    assert capsys.readouterr().err.count("a worker process did not start: status 7") <= ATTEMPTS


def test_where_no_process_starts_every_condition_has_failed(run: Run) -> None:
    ended, _ = run([["a"], ["b", "c"]], [_gpu("0"), _gpu("1")], broken=frozenset({"0", "1"}))
    assert sorted((one.job.method, one.error) for one in ended) == [
        (x, "no worker process could start: status 7") for x in "abc"
    ]
    assert all(one.untried for one in ended)


def test_an_error_that_ends_all_leaves_no_process_behind(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    closed: list[str] = []
    monkeypatch.setattr(FakeProcess, "close", lambda process: closed.append(process.place))

    def fail() -> None:
        raise BrokenPipeError

    with pytest.raises(BrokenPipeError):
        run([["a"]], [_gpu("0")], took=fail)
    assert closed == ["0"]


def test_an_interrupt_before_a_thread_has_started_ends_all(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def start(thread: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("threading.Thread.start", start)
    with pytest.raises(KeyboardInterrupt):
        run([["a"]], [_gpu("0"), _gpu("1")])


def test_a_condition_on_several_gpus_leaves_them_to_others_when_it_has_ended(run: Run) -> None:
    wide = Seat(gpus.seeing_only(["0", "1"]), Job("", "wide", "parity"), (_gpu("0"), _gpu("1")))
    ended, log = run(
        [["wide"], *([str(number)] for number in range(8))], [wide, _gpu("2")], took=lambda: time.sleep(0.02)
    )
    assert len(ended) == 9
    assert [place for place, name in log if name == "wide"] == ["0,1"]
    rest = {place for place, name in log if name != "wide"}
    assert rest == {"0", "1", "2"}


def test_a_condition_that_dies_on_several_gpus_is_begun_again_on_one(run: Run) -> None:
    wide = Seat(gpus.seeing_only(["0", "1"]), Job("", "wide", "parity"), (_gpu("0"), _gpu("1")))
    ended, log = run([["wide"]], [wide], deadly=Counter(wide=1))
    assert [(one.job.method, one.error) for one in ended] == [("wide", "")]
    (first, _), (second, _) = log
    assert (first, second in ("0", "1")) == ("0,1", True)


@given(works, st.integers(2, 9))
def test_conditions_of_two_shares_have_several_gpus_and_there_are_always_enough(took: list[float], count: int) -> None:
    batches = sorted((_batch(str(i), work) for i, work in enumerate(took)), key=lambda one: -one.cost.seconds())
    found = tuple(map(str, range(count)))
    made = seats_of(Host(AUTO, found), batches)
    assert sorted(gpu for seat in made for gpu in seat.environment[gpus.VISIBLE].split(",")) == sorted(found)
    share = sum(took) / count
    for seat in made:
        number = len(seat.environment[gpus.VISIBLE].split(","))
        if seat.first is None:
            assert (number, seat.then) == (1, ())
        else:
            assert number == len(seat.then) == min(10, int(took[int(seat.first.method)] / share), count) >= 2


def test_two_processes_share_a_gpu_under_mps_where_batches_are_more_than_gpus() -> None:
    equal = [_batch(str(i), 10.0) for i in range(9)]
    host = Host(AUTO, ("0", "1"), together=2)
    for batches, used in ((1, "0,1"), (2, "0 1"), (3, "0 1 0"), (4, "0 1 0 1"), (9, "0 1 0 1")):
        seats = seats_of(host, equal[:batches])
        assert [seat.environment[gpus.VISIBLE] for seat in seats] == used.split()
        crowds = Counter(used.split())
        halves = [crowds[seat.environment[gpus.VISIBLE]] == 2 for seat in seats]
        assert [gpus.MEMORY in seat.environment for seat in seats] == halves
    (alone,) = seats_of(Host(AUTO, ("0",), together=2), equal[:1])
    assert alone.environment == {gpus.VISIBLE: "0"}
    long = [_batch("long", 1000.0), *(_batch(str(i), 1.0) for i in range(9))]
    three = seats_of(Host(AUTO, ("0", "1", "2"), together=2), long)
    assert [seat.environment[gpus.VISIBLE] for seat in three] == ["0,1", "2", "2"]


def test_processes_are_as_many_as_keep_the_cores_busy() -> None:
    running = [_batch(str(i), 1000.0, 0.0, Layout.ALONE) for i in range(50)]  # ten trials each
    compiling = [_batch(str(i), 0.0, 10.0, Layout.ALONE) for i in range(50)]
    assert useful_processes(running, 64) == 7
    assert useful_processes(running, 2) == 1
    assert useful_processes([*running, _batch("compiled", 0.0, 4_000.0, Layout.ALONE)], 2) == 1
    assert useful_processes([*running, _batch("compiled", 0.0, 10_000.0, Layout.ALONE)], 2) == 2
    assert useful_processes(compiling, 64) == 64
    assert useful_processes(compiling, 2) == 2
    assert len(seats_of(Host(AUTO, ()), compiling[:1])) == 1
    assert len(seats_of(Host(3, ()), compiling)) == 3
    assert seats_of(Host(3, ()), []) == []


def test_a_number_of_processes_is_one_or_more(monkeypatch: pytest.MonkeyPatch) -> None:
    assert host_of("3", "cpu") == Host(3, ())
    assert host_of("auto", "cpu") == Host(AUTO, ())
    for text in ("0", "-1", "many", ""):
        with pytest.raises(UserError, match="--numprocesses takes a number from 1 up, or auto"):
            host_of(text, "cpu")


@pytest.mark.parametrize(
    ("text", "found", "mps", "alone"),
    [
        ("1", 4, False, True),
        ("1", 1, True, True),
        ("auto", 1, False, True),
        ("auto", 1, True, False),
        ("auto", 4, False, False),
        ("2", 1, False, False),
        ("auto", 0, False, False),
        ("auto", 0, True, False),
    ],
)
def test_a_command_whose_processes_have_gpus_keeps_off_these_itself(
    text: str, found: int, mps: bool, alone: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    off: list[bool] = []
    monkeypatch.setattr(gpus, "mps_runs", lambda: mps)
    monkeypatch.setattr(gpus, "gpus", lambda device: tuple(map(str, range(found))))
    monkeypatch.setattr("evoclaims.trials.devices.keep_off_gpus", lambda: off.append(True))
    host = host_of(text, "auto")
    assert host.alone == alone
    assert host.together == (2 if mps and found else 1)
    assert off == [True] * (found > 0 and not alone)


LOOKS = """
import sys
import time
from jax._src import xla_bridge
from evoclaims.execution import host as gpus
from evoclaims.trials import devices

def keep_off_gpus():
    print("looked before" if xla_bridge.backends_are_initialized() else "has not looked")
    sys.exit()

gpus.gpus, devices.keep_off_gpus = lambda device: ("0", "1"), keep_off_gpus
from evoclaims.cli import main
main(sys.argv[1:])
"""


def test_a_command_keeps_off_gpus_before_libraries_make_arrays_as_they_are_imported(project: Project) -> None:
    call = [sys.executable, "-c", LOOKS, "power", "--run", "--numprocesses", "auto"]
    found = subprocess.run(call, cwd=project.path, capture_output=True, text=True, check=False)
    assert found.stdout == "has not looked\n", found.stderr


DEADLY = '''
import os
import signal


class Killed(Coin):
    """Kills its process, as the system does where memory runs out, as often as the file says."""

    name: ClassVar[str] = "killed"

    def init(self, key, task):
        left = Path(__file__).with_name("deaths")
        number = int(left.read_text())
        left.write_text(str(number - 1))
        if number > 0:
            os.kill(os.getpid(), signal.SIGKILL)
        return super().init(key, task)


METHODS = {"right": HandBuilt(), "killed": Killed(), "wrong": HandBuilt(negated=True)}
'''


@pytest.fixture
def deadly(project: Project) -> Project:
    """The tiny paper, with a method that kills its process."""
    head, tail = REPRODUCTION.split("METHODS = {")
    project.pytester.makepyfile(tiny_paper=head + DEADLY + tail.split("\n", 1)[1])
    return project


@pytest.mark.usefixtures("deadly")
def test_a_killed_workers_batch_is_done_again_and_nothing_is_lost_or_twice(evoclaims: Evoclaims) -> None:
    Path("deaths").write_text("1")
    status, out, err = evoclaims("run", "--on=parity", "--numprocesses=2", "--trials=3")
    assert (status, err.count("it is begun again")) == (0, 1)
    assert "killed on parity: its process died (SIGKILL: the system sends that where memory runs out)" in err
    store, alone = Store(Path(".evoclaims")), Store(Path("alone"))
    assert len(store.ids()) == 9
    assert verify(store, repair=False) == []
    assert out.count("3 of 3 conditions have ended") == 1
    assert evoclaims("run", "--on=parity", "--trials=3", "--storage=alone")[0] == 0
    assert [trial.digest for trial in store.results([])] == [trial.digest for trial in alone.results([])]
