"""Trials through SLURM itself, on two nodes of this machine: every trial is that of a local run, and none runs twice.

These tests start a cluster (see `cluster.py`); where SLURM is not installed, they are skipped and say so.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from cluster import Cluster, lacks
from filelock import FileLock

from evoclaims.trials.store import Store

HERE = Path(__file__).parent
PYPROJECT = '[tool.evoclaims]\nreproduction = "slurm_paper"\n[tool.evoclaims.slurm]\npartition = "work"\narray = 8\n'
CONDITIONS, TRIALS = 9, 10

pytestmark = pytest.mark.slow
pytest.importorskip("submitit", reason="jobs are NOT TESTED here: submitit is not installed (evoclaims[slurm])")
if lacks():
    pytest.skip(f"jobs on SLURM are NOT TESTED here: this machine lacks {lacks()}", allow_module_level=True)


@pytest.fixture(scope="module")
def cluster() -> Iterator[Cluster]:
    """SLURM with two nodes of one core each; a machine has one at a time, also where workers share these tests."""
    with FileLock(Path(tempfile.gettempdir()) / "evoclaims-slurm.lock"):
        folder = Path(tempfile.mkdtemp(prefix="slurm-"))
        one = Cluster(folder)
        try:
            one.start()
            yield one
        finally:
            one.stop()
            shutil.rmtree(folder, ignore_errors=True)


class Paper:
    """The paper in a folder of its own, used as a person does; its processes rest `pause` seconds at each report."""

    def __init__(self, folder: Path, cluster: Cluster, pause: float) -> None:
        self.folder, self.cluster = folder, cluster
        self.store = Store(folder / ".evoclaims")
        (folder / "pyproject.toml").write_text(PYPROJECT)
        (folder / "claims").mkdir()
        apart = [HERE, HERE.parent / "torture", HERE.parent / "trials"]
        self.environment = {
            **os.environ,
            **cluster.environment,
            "PYTHONPATH": os.pathsep.join([*map(str, apart), *sys.path]),
            "TORTURE_LOG": str(folder / "said.log"),
            "TORTURE_PAUSE": str(pause),
        }

    def __call__(self, *arguments: str) -> tuple[int, str]:
        """Run a command; return its status and all that it said."""
        done = subprocess.run(
            [sys.executable, "-m", "evoclaims", *arguments],
            cwd=self.folder,
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=300,
        )
        assert "Traceback" not in done.stdout, done.stdout
        return done.returncode, done.stdout

    def jobs(self) -> dict[str, str]:
        """Return all jobs that SLURM knows, with their states."""
        listed = self.cluster.ask("squeue", "-h", "-r", "--states=all", "--format=%i %T")
        return {job: state for job, state in (line.split() for line in listed.splitlines())}  # noqa: C416

    def running(self, node: str = "node[0-1]") -> list[str]:
        """Return the jobs whose trials are in the middle, on a node or on any."""
        asked = self.cluster.ask("squeue", "-h", "-r", "--states=running", f"--nodelist={node}", "--format=%i").split()
        return [job for job in asked if "walker on " in self.log(job)]  # the first line of progress

    def sbatch(self, *options: str) -> None:
        """Submit a job that is not ours."""
        subprocess.run(["sbatch", *options], cwd=self.folder, env=self.environment, check=True, capture_output=True)

    def log(self, job: str) -> str:
        """Return what a job has said."""
        return "".join(path.read_text() for path in self.store.root.glob(f"jobs/*/{job}_0_log.out"))

    def wait(self, until: Callable[[], Any], seconds: float = 300.0) -> Any:
        """Wait until a function returns something true, and return that."""
        end = time.monotonic() + seconds
        while not (found := until()):
            assert time.monotonic() < end, f"{self.jobs()}\n{self('jobs')[1]}"
            time.sleep(0.5)
        return found

    def wait_for_jobs(self) -> None:
        """Wait until no job is queued or running."""
        self.wait(lambda: not self.cluster.ask("squeue", "-h").strip())

    def digests(self) -> dict[str, str]:
        """Return the trials' digests by id; all files are sound."""
        errors: list[Any] = []
        found = {trial.id: trial.digest for trial in self.store.results(errors)}
        assert not errors
        return found

    def put(self) -> Counter[str]:
        """Return how often each trial came to its end in a process."""
        lines = map(json.loads, (self.folder / "said.log").read_text().splitlines())
        return Counter(line["id"] for line in lines if line["what"] == "put")


@pytest.fixture
def paper(tmp_path: Path, cluster: Cluster) -> Callable[[float], Paper]:
    """A function that returns the paper, whose processes rest so long."""

    def made(pause: float) -> Paper:
        folder = tmp_path / f"paper-{pause:g}"
        folder.mkdir()
        return Paper(folder, cluster, pause)

    return made


@pytest.fixture(scope="module")
def locally(tmp_path_factory: pytest.TempPathFactory, cluster: Cluster) -> dict[str, str]:
    """The digests of the trials, by id, of one process."""
    local = Paper(tmp_path_factory.mktemp("local"), cluster, 0.0)
    assert local("run", "--on", "parity")[0] == 0
    found = local.digests()
    assert len(found) == CONDITIONS * TRIALS
    return found


def test_two_nodes_store_the_trials_of_a_local_run_each_once(
    paper: Callable[[float], Paper], locally: dict[str, str]
) -> None:
    one = paper(0.02)
    assert (
        "9 batches of the smoke tier in 9 jobs on SLURM, at most 8 at a time"
        in one("submit", "--on", "parity", "--dry-run")[1]
    )
    assert one.jobs() == {}
    status, said = one("submit", "--on", "parity", "--slurm", "comment=a test")
    assert status == 0, said
    judge = said.rpartition("sbatch ")[2].rpartition(".")[0]
    assert "Nothing to submit" in one("submit", "--on", "parity")[1]
    assert "queued" in one("jobs")[1]
    assert len(one.jobs()) == CONDITIONS
    wrapped = judge.partition("--wrap=")[2].strip("'").replace("pytest", f"{sys.executable} -m pytest", 1)
    one.sbatch("--output=judged.out", judge.partition(" ")[0], f"--wrap={wrapped} -p no:cacheprovider")
    one.wait_for_jobs()
    nodes = one.cluster.ask("squeue", "-h", "-r", "--states=all", "--name=evoclaims", "--format=%N").split()
    assert set(nodes) == {"node0", "node1"}
    assert one.digests() == locally
    assert set(one.put().values()) == {1}
    status, said = one("jobs")
    assert (status, said.splitlines()[-1]) == (0, "9 done")
    assert "Nothing to submit" in one("submit", "--on", "parity")[1]
    assert "collected 0 items" in (one.folder / "judged.out").read_text()  # this paper has no claims


def test_cancelled_requeued_preempted_and_killed_jobs_lose_and_repeat_nothing(
    paper: Callable[[float], Paper], locally: dict[str, str]
) -> None:
    one = paper(0.25)
    assert one("submit", "--on", "parity")[0] == 0
    first, second = one.wait(lambda: len(at := one.running()) == 2 and sorted(at))
    array = first.partition("_")[0]
    one.cluster.ask("scancel", first, f"{array}_4", f"{array}_6")
    one.cluster.ask("scontrol", "requeue", second)
    one.wait(lambda: one.jobs()[first] == "CANCELLED")
    status, said = one("jobs")
    assert status == 1
    assert said.count("\nfailed") + said.startswith("failed") == 3
    assert re.search(rf"failed   {first}  walker\d on parity, smoke: cancelled on node\d; interrupted; ", said)

    preempted = one.wait(lambda: one.running("node0"))
    one.sbatch("--partition=urgent", "--nodelist=node0", "--output=/dev/null", "--wrap=sleep 2")
    one.wait(lambda: "DUE TO PREEMPTION" in one.log(preempted[0]))

    lost = one.wait(lambda: one.running("node1"))
    one.cluster.kill_node("node1")
    one.wait(lambda: one.cluster.states()["node1"].startswith("down"))
    one.cluster.start_node("node1")
    one.wait_for_jobs()
    for job in (second, *preempted, *lost):
        assert one.log(job).count("$ ") >= 2  # it was started again

    assert "Submitted 3 jobs" in one("submit", "--on", "parity")[1]
    one.wait_for_jobs()
    assert one.digests() == locally
    assert set(one.put().values()) == {1}
    assert one("jobs")[1].splitlines()[-1] == "9 done"
    assert not list(one.store.checkpoints.glob("*"))


def test_a_job_out_of_time_writes_a_checkpoint_and_goes_on_in_another(
    paper: Callable[[float], Paper], locally: dict[str, str]
) -> None:
    one = paper(0.9)
    status, said = one("submit", "walker8", "--time", "1")
    assert status == 0, said
    one.wait_for_jobs()
    (job,) = (job for job in one.jobs() if one.log(job))
    told = one.log(job)
    assert "interrupted; the same command goes on from the last checkpoint" in told
    assert "Requeued job" in told or "requeue" in told
    assert told.count("$ ") >= 2
    assert "resuming" in told
    stored = one.digests()
    assert len(stored) == TRIALS
    assert stored.items() <= locally.items()
    assert set(one.put().values()) == {1}
