"""`evoclaims submit` and `jobs`: what a stand-in for SLURM is asked for, and real jobs of this machine.

Jobs on SLURM itself are tested in tests/slurm.
"""

from __future__ import annotations

import os
import shlex
import signal
import socket
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tiny_project import PYPROJECT, Evoclaims, trials_of

from evoclaims.cli import jobs, submit
from evoclaims.cli.submit import dealt
from evoclaims.cluster import submissions
from evoclaims.cluster.job import BatchJob, minutes_of
from evoclaims.cluster.submissions import Seen, State, load_all
from evoclaims.execution.job import Job, MissingBatch
from evoclaims.paper.cost import Cost
from evoclaims.trials.layout import Layout
from evoclaims.trials.lease import announced, lease_path
from evoclaims.trials.store import Store

pytest.importorskip("submitit", reason="jobs are NOT TESTED here: submitit is not installed (evoclaims[slurm])")

SITE = """
[tool.evoclaims.slurm]
partition = "gpu"
gpus = 1
time = "30"
account = "lab"
setup = ["module load cuda"]
"""


class StandIn:
    """Programs that are called as SLURM's are, and answer what a test wants."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.script, self.queue = folder, folder / "script", folder / "queue"
        self.program("sbatch", f'cp "$1" {self.script}; echo Submitted batch job 41')
        self.program("squeue", f"cat {self.queue}")
        self.program("srun", "exit 1")
        self.queue.write_text("")

    def program(self, name: str, line: str) -> None:
        """Write a program of one line of shell."""
        (self.folder / name).write_text(f"#!/bin/sh\n{line}\n")
        (self.folder / name).chmod(0o755)

    def asked(self) -> set[str]:
        """Return what the last job array has asked for, and forget it."""
        lines = self.script.read_text().splitlines()
        self.script.unlink()
        return {line.removeprefix("#SBATCH --") for line in lines if line.startswith("#SBATCH")}


@pytest.fixture
def slurm(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> StandIn:
    folder = tmp_path_factory.mktemp("bin")
    monkeypatch.setenv("PATH", str(folder), prepend=os.pathsep)
    return StandIn(folder)


def test_a_site_says_in_two_lines_what_jobs_ask_for_and_options_come_first(
    evoclaims: Evoclaims, slurm: StandIn
) -> None:
    Path("pyproject.toml").write_text(PYPROJECT + SITE)
    assert evoclaims("submit", "--on=parity", "--array=2", "--slurm=qos=night", "--slurm", "exclusive")[0] == 0
    script = slurm.script.read_text()
    assert "\nmodule load cuda\n" in script
    asked = slurm.asked()
    assert {"array=0-3%2", "partition=gpu", "gpus-per-node=1", "time=30", "account=lab", "qos=night"} < asked
    assert {"exclusive", "requeue", "signal=USR2@90", "open-mode=append"} < asked
    _, out, _ = evoclaims(
        "submit", "right", "--gpus=0", "--time=2h", "--partition=cpu", "--slurm=account=other", "--dry-run"
    )
    assert "each with partition cpu, 2:00:00 of time, account=other" in out


def test_nothing_is_submitted_twice_and_what_failed_is_submitted_again(evoclaims: Evoclaims, slurm: StandIn) -> None:
    status, out, _ = evoclaims("submit", "--on=parity")
    assert (status, len(out.splitlines())) == (0, 8)
    assert "4 batches of the smoke tier in 4 jobs on SLURM, at most 4 at a time, each with 2:00:00 of time:" in out
    assert "sbatch --dependency=afterany:41 --wrap='pytest -m smoke --claims-stored" in out
    assert slurm.asked()
    slurm.queue.write_text("41_0|PENDING|Priority|\n41_1|RUNNING|None|node7\n41_2|OUT_OF_MEMORY|OutOfMemory|node8\n")
    status, out, _ = evoclaims("jobs")
    lines = out.splitlines()
    assert status == 1
    assert lines[0].startswith("queued   41_0  ")
    assert lines[0].endswith(", smoke: Priority")
    assert lines[1].endswith(", smoke: on node7")
    assert lines[2].endswith(", smoke: out of memory on node8")
    assert lines[3].endswith(", smoke: it is no longer queued and has printed nothing")
    assert lines[4] == "1 queued, 1 running, 2 failed"
    _, out, _ = evoclaims("submit", "--on=parity")
    assert "queued already, as job 41_0" in out
    assert "running already, as job 41_1" in out
    assert "2 batches of the smoke tier" in out
    assert "array=0-1%2" in slurm.asked()


def test_what_a_variant_changes_is_submitted_under_it(evoclaims: Evoclaims, slurm: StandIn) -> None:
    status, out, _ = evoclaims("submit", "--variant=traded")
    assert status == 0
    assert "1 batch of the smoke tier in 1 job on SLURM" in out
    assert "right on parity: 10 trials" in out
    assert "--claims-variant=traded" in out
    slurm.queue.write_text("41|PENDING|Priority|\n")
    assert evoclaims("jobs")[1].splitlines()[0] == "queued   41  right on parity, smoke, traded: Priority"
    assert "queued already" in evoclaims("submit", "--variant=traded")[1]
    status, _, err = evoclaims("submit", "coin", "--variant=traded")
    assert (status, err.count("\n")) == (2, 1)
    assert "The variant traded changes none of these conditions at the smoke tier; it changes: right on parity." in err


def test_the_cores_of_a_job_are_told_and_asked_for(evoclaims: Evoclaims, slurm: StandIn) -> None:
    status, out, _ = evoclaims("submit", "right", "--cpus=4", "--dry-run")
    assert status == 0
    assert "1 batch of the smoke tier in 1 job on SLURM, at most 1 at a time, each with 4 CPU cores, " in out
    assert not slurm.script.exists()
    assert "CPU core" not in evoclaims("submit", "right", "--dry-run")[1]
    assert evoclaims("submit", "right", "--cpus=4")[0] == 0
    assert "cpus-per-task=4" in slurm.asked()


@pytest.mark.usefixtures("stored")
def test_only_what_is_missing_is_submitted(evoclaims: Evoclaims, slurm: StandIn) -> None:
    assert "Nothing to submit: no batch of the smoke tier is missing." in evoclaims("submit", "right")[1]
    assert not slurm.script.exists()
    assert "2 batches of the smoke tier in 2 jobs" in evoclaims("submit", "--on=parity")[1]  # neither right nor wrong


def test_the_words_of_a_site_between_squeues_lines_are_skipped(evoclaims: Evoclaims, slurm: StandIn) -> None:
    assert evoclaims("submit", "right", "--on=parity")[0] == 0
    slurm.queue.write_text("Maintenance on Monday | 8 o'clock\n41|PENDING|Priority|\n")
    status, out, _ = evoclaims("jobs")
    assert status == 0
    assert out.startswith("queued   41  right on parity, smoke: Priority\n")


@pytest.mark.usefixtures("stored")
def test_more_trials_than_the_tiers_are_submitted_and_looked_for(evoclaims: Evoclaims, slurm: StandIn) -> None:
    """Those of a third look, for example."""
    _, out, _ = evoclaims("submit", "right", "--on=parity", "--trials=12")
    assert "right on parity: 2 trials" in out
    (submission,) = load_all(Path(".evoclaims")).values()
    assert submission.trials == 12
    assert evoclaims("jobs")[1].splitlines()[-2] == "1 failed"  # two are missing
    assert "--trials takes 1 to 100 trials" in evoclaims("submit", "right", "--trials=101")[2]


@pytest.mark.usefixtures("stored")
def test_a_job_runs_the_seeds_of_the_design(evoclaims: Evoclaims, slurm: StandIn) -> None:
    paper = Path("tiny_paper.py")
    design = "Design(looks=Design.fixed(10).looks, first_seed=500)"
    paper.write_text(paper.read_text(encoding="utf-8").replace("Design.fixed(10)", design, 1), encoding="utf-8")
    sys.modules.pop("tiny_paper", None)
    assert evoclaims("run", "right", "--on=parity")[0] == 0
    assert "no batch of the smoke tier is missing" in evoclaims("submit", "right", "--on=parity")[1]
    seeds = {trial.seed for trial in trials_of(Store(Path(".evoclaims")), "hand_built")}
    assert seeds == {*range(10), *range(500, 510)}


@pytest.mark.usefixtures("stored")
def test_trials_out_of_time_are_done_and_said(evoclaims: Evoclaims, slurm: StandIn) -> None:
    store = Store(Path(".evoclaims"))
    late = [replace(trial, status="timeout", champion="") for trial in trials_of(store, "hand_built")]
    for path in store.record_paths():
        path.unlink()
    assert evoclaims("submit", "right", "--on=parity")[0] == 0
    for trial in late:
        store.put(replace(trial, timing={**trial.timing, "limit": 1e9}), {})
    said = ": 10 of 10 trials ran out of time (evoclaims run --retry goes on with them)"
    assert evoclaims("jobs")[1].splitlines()[0].endswith(said)


def test_a_job_whose_condition_was_edited_is_not_done(evoclaims: Evoclaims, slurm: StandIn) -> None:
    assert evoclaims("submit", "right", "--on=parity")[0] == 0
    slurm.queue.write_text("41|RUNNING|None|node7\n")
    (submission,) = Path(".evoclaims/jobs").glob("*.json")
    (batch,) = load_all(Path(".evoclaims"))[submission.stem].jobs[0].batches
    submission.write_text(submission.read_text().replace(batch.condition, "e" * 64))
    assert evoclaims("jobs")[1].startswith("running  41  right on parity, smoke: on node7")
    slurm.queue.write_text("")
    status, out, _ = evoclaims("jobs")
    assert (status, out.splitlines()[-1]) == (0, "1 ended")
    assert "the paper has no such condition any more: it was edited or taken out" in out


@pytest.mark.usefixtures("stored")
def test_a_damaged_record_does_not_hide_what_has_become_of_jobs(evoclaims: Evoclaims, slurm: StandIn) -> None:
    record = next(iter(Store(Path(".evoclaims")).record_paths()))
    record.unlink()
    assert evoclaims("submit", "--on=parity")[0] == 0
    record.write_bytes(b"torn")
    status, out, _ = evoclaims("jobs")
    assert status == 1
    assert out.splitlines()[-2] == "3 failed"  # the damaged one, and two that nobody has run


def test_of_a_job_s_batches_that_one_runs_which_a_living_process_has_announced(
    evoclaims: Evoclaims, monkeypatch: pytest.MonkeyPatch
) -> None:
    at_work = Seen(State.RUNNING, "process 1")
    monkeypatch.setattr(submit, "_send", lambda *_: ["1"])
    monkeypatch.setattr(jobs, "states", lambda submission, asked: dict.fromkeys(asked, at_work))
    root = Path(".evoclaims")
    assert evoclaims("submit", "--on=parity", "--cluster=local")[0] == 0
    (submission,) = load_all(root).values()
    first, second, *_ = (batch.condition for batch in submission.jobs[0].batches)
    killed = subprocess.Popen(["true"])
    killed.wait()
    owner = f"pid={killed.pid}\nhost={socket.gethostname()}\nmode=lease\ntoken={'a' * 32}\nduration=60.0\n"
    with announced(root, second):
        lease_path(root, first).write_text(f"filelock/2\n{owner}")
        lines = evoclaims("jobs")[1].splitlines()
    assert lines[0].startswith("queued ")
    assert lines[0].endswith(": process 1 runs other batches now")
    assert lines[1].startswith("running ")
    assert lines[-1] == "3 queued, 1 running"


def test_jobs_of_this_machine_are_estimated_on_its_gpus(evoclaims: Evoclaims, monkeypatch: pytest.MonkeyPatch) -> None:
    assert " hours of a job, " in evoclaims("submit", "--cluster=local", "--dry-run")[1]
    monkeypatch.setattr(submit, "gpus", lambda device: ("0",))
    assert " hours of a GPU, " in evoclaims("submit", "--cluster=local", "--dry-run")[1]
    assert " hours of a job, " in evoclaims("submit", "--cluster=local", "--device=cpu", "--dry-run")[1]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--cluster=cloud"], "cluster"),
        (["--time=soon"], "A job's time is a length of time such as 2:00:00 or 2h, not 'soon'"),
        (["--time=0"], "A job's time must be above 0, not '0'."),
        (["--gpus=-1"], "--gpus takes a number from 0 up, not -1."),
        (["--cpus=-1", "--dry-run"], "--cpus takes a number from 0 up, not -1."),
        (["--array=0"], "--array takes a number from 1 up, not 0."),
        (["--slurm=time=3"], "The option time of sbatch cannot be passed through: use --time."),
        (["--slurm=output=x"], "The option output of sbatch cannot be passed through: evoclaims sets it."),
        (["--slurm==3"], "An option of sbatch is a name and a text or a number"),
        (["--slurm=a=1\n#SBATCH --uid=0"], "An option of sbatch is a name and a text or a number"),
        (["--cluster=local", "--slurm=account=lab"], "--slurm is only for SLURM jobs"),
        (["nobody"], "nobody"),
    ],
)
@pytest.mark.usefixtures("slurm")
def test_what_means_nothing_is_a_sentence(evoclaims: Evoclaims, arguments: list[str], sentence: str) -> None:
    status, _, err = evoclaims("submit", *arguments)
    assert status == 2
    assert sentence in err
    assert not Path(".evoclaims/jobs").exists()


def test_a_site_s_table_is_checked(evoclaims: Evoclaims, slurm: StandIn) -> None:
    Path("pyproject.toml").write_text(PYPROJECT + '\n[tool.evoclaims.slurm]\ngpus = "one"\n')
    assert "In pyproject.toml, [tool.evoclaims.slurm]: Expected `int`, got `str`" in evoclaims("submit")[2]


def test_without_slurm_or_submitit_a_sentence_says_what_to_do(
    evoclaims: Evoclaims, slurm: StandIn, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "submitit", None)
    assert "pip install 'evoclaims[slurm]'" in evoclaims("submit")[2]
    monkeypatch.setenv("PATH", "/nowhere")
    assert "There is no SLURM here (no sbatch): --cluster local runs" in evoclaims("submit")[2]


def test_what_slurm_refuses_is_a_sentence_and_leaves_nothing(evoclaims: Evoclaims, slurm: StandIn) -> None:
    slurm.program("sbatch", "echo 'sbatch: error: invalid partition specified: gpu' >&2; exit 1")
    status, _, err = evoclaims("submit")
    assert status == 2
    assert "The jobs were not submitted: sbatch: error: invalid partition specified: gpu" in err
    assert not list(Path(".evoclaims/jobs").glob("*"))


def test_a_silent_slurm_and_a_torn_record_are_sentences(evoclaims: Evoclaims, slurm: StandIn) -> None:
    assert evoclaims("submit", "right")[0] == 0
    slurm.queue.unlink()
    status, _, err = evoclaims("submit", "right")
    assert status == 2
    assert "SLURM does not say which jobs are queued (squeue: cat: " in err
    (path,) = Path(".evoclaims/jobs").glob("*.json")
    path.write_text(path.read_text().replace('"41"', '"41; rm -rf ~"'))
    status, _, err = evoclaims("jobs")
    assert status == 2
    assert f"Cannot read the list of submitted jobs, {path}: " in err


def test_jobs_of_this_machine_store_their_trials_and_failures_say_why(evoclaims: Evoclaims) -> None:
    """Two jobs: one network by the toss of a coin, and one that raises."""
    until = time.monotonic() + 300
    for method in ("coin", "broken"):
        status, out, _ = evoclaims("submit", method, "--cluster=local")
        assert status == 0
        process = out.partition("Submitted 1 job, from ")[2].split()[0]
        while os.readlink(f"/proc/{process}/fd/1") != os.devnull:  # `evoclaims submit | tee log` does not wait for it
            assert time.monotonic() < until
    assert "already, as job" in evoclaims("submit", "broken", "--cluster=local")[1]
    while "running" in (told := evoclaims("jobs"))[1]:
        assert time.monotonic() < until
        time.sleep(0.5)
    status, out, _ = told
    done, failed, counted, _ = out.splitlines()
    assert status == 1
    assert done.startswith("done ")
    assert failed.startswith("failed ")
    assert "broken on parity (smoke) failed: RuntimeError: out of order" in failed
    assert Path(failed.rpartition("(")[2].rstrip(")")).read_text().count("$ ") == 1
    assert counted == "1 done, 1 failed"
    assert len(Store(Path(".evoclaims")).ids()) == 10
    assert evoclaims("jobs", "--storage=elsewhere")[0] == 2


@pytest.mark.parametrize(
    ("text", "minutes"),
    [("30", 30), ("30:01", 31), ("2:00:00", 120), ("1-12", 2160), ("1-0:30", 1470), ("2h", 120), ("90s", 2)],
)
def test_a_time_is_written_as_slurm_does_or_as_we_do(text: str, minutes: int) -> None:
    assert minutes_of(text) == minutes


@given(st.lists(st.floats(0.1, 1000)), st.integers(1, 5))
def test_batches_of_this_machine_are_dealt_once_and_evenly(seconds: list[float], jobs: int) -> None:
    each = sorted(seconds, reverse=True)
    costs = [Cost(0.0, took, 1, Layout.ALONE) for took in each]
    batches = [MissingBatch(Job("", "m", str(i)), (0,), cost) for i, cost in enumerate(costs)]
    hands = dealt(batches, jobs)
    assert sorted((one.job.task for hand in hands for one in hand), key=int) == [one.job.task for one in batches]
    sums = [sum(one.cost.seconds() for one in hand) for hand in hands]
    assert max(sums, default=0) - min(sums, default=0) <= max(each, default=0) + 1e-9


def test_a_job_ends_its_batch_before_it_is_requeued_and_is_pickled_as_text(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    slow = "import signal, time; signal.signal(15, lambda *_: exit(open('told', 'w').close())); time.sleep(60)"
    job = BatchJob([[sys.executable, "-c", slow]], str(tmp_path))
    pickled = tmp_path / "pickled"

    def told(*_: Any) -> None:
        os.kill(job.process, signal.SIGUSR2)  # SLURM tells all processes; only the checkpoint ends the batch
        job.checkpoint().dump(pickled)
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, told)
    signal.setitimer(signal.ITIMER_REAL, 1.0)
    try:
        with pytest.raises(TimeoutError):
            job()
    finally:
        signal.signal(signal.SIGALRM, before)
    assert Path("told").exists()
    assert job.process == 0
    load = "import pickle, sys; pickle.load(open(sys.argv[1], 'rb')); print('jax' in sys.modules)"
    assert subprocess.check_output([sys.executable, "-c", load, str(pickled)]) == b"False\n"


def test_a_job_s_failed_batches_are_counted_and_do_not_stop_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    python = [sys.executable, "-S", "-c"]
    commands = [
        [*python, "raise SystemExit(1)"],
        [*python, "import os; os.kill(os.getpid(), 9)"],
        [*python, "print(7)"],
    ]
    with pytest.raises(RuntimeError, match="2 of 3 batches failed"):
        BatchJob(commands, str(tmp_path))()
    out = capfd.readouterr().out
    assert "evoclaims: the process died of SIGKILL." in out
    assert out.endswith(f"\n$ {shlex.join(commands[2])}\n7\n")  # for a shell


def test_another_machine_s_process_may_still_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(submissions.socket, "gethostname", lambda: "here")
    local = submit.Submission(1, "local", "there", "smoke", ())
    assert submissions.states(local, ["7"])["7"].state == "running"
