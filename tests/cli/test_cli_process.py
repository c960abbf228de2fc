"""The command as a process of its own."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from importlib import metadata
from pathlib import Path

import pytest
from tiny_project import Project, trials_of

from evoclaims.trials.store import Store

COMMAND = "from evoclaims.cli import main; raise SystemExit(main())"


def _evoclaims(folder: Path, *arguments: str, code: str = COMMAND) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    return subprocess.run(
        [sys.executable, "-c", code, *arguments],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


HELP = """
import sys
from evoclaims.cli import main
for arguments in (["--version"], ["--help"], ["run", "--help"], ["runn"], []):
    try:
        main(arguments)
    except SystemExit as end:
        print("ended with", end.code, *sorted({"jax", "numpy", "rich", "pytest"} & sys.modules.keys()))
"""


def test_help_and_unknown_commands_wait_for_no_library(tmp_path: Path) -> None:
    done = _evoclaims(tmp_path, code=HELP)
    ends = [line for line in done.stdout.splitlines() if line.startswith("ended")]
    assert ends == [*["ended with 0"] * 3, *["ended with 2"] * 2], done.stderr
    assert done.stdout.startswith(f"evoclaims {metadata.version('evoclaims')}\n")
    assert "invalid choice: 'runn'" in done.stderr


SLOW = """    def init(self, key, task):
        import time; time.sleep(600)
        return jnp.where"""


def test_a_second_ctrl_c_ends_a_run_by_its_sentence_and_loses_no_trial(project: Project) -> None:
    project.write(a="supported", c="undecided")
    paper = project.path / "tiny_paper.py"
    text = paper.read_text(encoding="utf-8")
    paper.write_text(text.replace("    def init(self, key, task):\n        return jnp.where", SLOW), encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", COMMAND, "run", "--numprocesses=2"]
    with subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True) as run:
        assert run.stderr is not None
        store, deadline = Store(project.path / ".evoclaims"), time.monotonic() + 120
        while len(store.ids()) < 10 and time.monotonic() < deadline:
            time.sleep(0.05)
        run.send_signal(signal.SIGINT)
        sentence = "evoclaims: interrupted; the same command goes on from the last checkpoint.\n"
        said = next(line for line in run.stderr if line == sentence or "Traceback" in line)
        while run.poll() is None and time.monotonic() < deadline:
            run.send_signal(signal.SIGINT)
            time.sleep(0.001)
        assert (run.returncode, said, run.stderr.read()) == (130, sentence, "")
    assert len(trials_of(store, "hand_built")) == 10


WITHOUT_JAX = """
import sys
from evoclaims.cli import main
print(main(sys.argv[1:]), *sorted({"jax", "scipy", "pandas"} & sys.modules.keys()))
"""


@pytest.mark.parametrize(
    ("arguments", "ends"), [(("verify",), "0"), (("status", "--storage=none"), "2"), (("report", "--storage="), "2")]
)
def test_a_command_that_computes_nothing_waits_for_no_large_library(
    project: Project, stored: Store, arguments: tuple[str, ...], ends: str
) -> None:
    done = _evoclaims(project.path, *arguments, code=WITHOUT_JAX)
    assert done.stdout.splitlines()[-1] == ends, done.stderr


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="Linux has a device that is a full disk")
@pytest.mark.parametrize(
    ("shell", "arguments", "ends", "out", "err"),
    [
        ("> /dev/full", "new made", 2, "", "evoclaims: Cannot write what is printed: No space left on device.\n"),
        ("2> /dev/full", "report --storage=", 2, "", ""),
        (">&-", "new made", 0, "", ""),
        ("2>&-", "report --storage=", 2, "", ""),
        ("", "status", 2, "", "evoclaims: The current folder cannot be used (No such file or directory). If it was"),
    ],
)
def test_a_full_disk_a_closed_stream_or_a_folder_that_is_gone_gives_no_traceback(
    tmp_path: Path, shell: str, arguments: str, ends: int, out: str, err: str
) -> None:
    there = "" if shell else 'rmdir "$PWD"; '
    script = f'cd "$0"; {there}exec "$1" -c "$2" {arguments} {shell}'
    done = subprocess.run(
        ["sh", "-c", script, str(tmp_path), sys.executable, COMMAND],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (ends, out), done.stderr
    assert done.stderr.startswith(err)
    assert done.stderr.count("\n") == (err != "")
