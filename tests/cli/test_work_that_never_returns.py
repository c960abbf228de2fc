"""Methods that never return: a loop in a program, a callback, and Python itself; each ends when its time is over."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from tiny_project import Project

STUCK = '''
import time

import numpy as np
from evoclaims.paper.reproduction import Reproduction


class Looping(Coin):
    """Its step is a loop without an end."""

    name: ClassVar[str] = "looping"

    def step(self, key, task, level, state):
        state = jax.lax.while_loop(lambda x: x < 2.0, jnp.tanh, state)
        return super().step(key, task, level, state)


class Calling(Coin):
    """Its step waits for a callback without an end."""

    name: ClassVar[str] = "calling"

    def step(self, key, task, level, state):
        def never(x):
            time.sleep(1e6)
            return x

        state = jax.pure_callback(never, jax.ShapeDtypeStruct((), jnp.float32), state)
        return super().step(key, task, level, state)


class Tracing(Coin):
    """It is never traced to its end."""

    name: ClassVar[str] = "tracing"

    def init(self, key, task):
        while True:
            pass


METHODS |= {"looping": Looping(), "calling": Calling(), "tracing": Tracing()}
TIERS = {"smoke": Tier(conditions(1), Protocol.fixed(10)), "full": Tier(conditions(2), Protocol.fixed(10))}
REPRODUCTION = replace(REPRODUCTION, tiers=TIERS)
'''

COMMAND = "from evoclaims.cli import main; raise SystemExit(main())"


def _stuck(project: Project) -> None:
    paper = project.path / "tiny_paper.py"
    paper.write_text(paper.read_text() + STUCK)


def _evoclaims(project: Project, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    return subprocess.run(
        [sys.executable, "-c", COMMAND, *arguments],
        cwd=project.path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


@pytest.mark.parametrize("method", ["looping", "calling", "tracing"])
def test_the_command_ends_with_its_trials_timed_out(project: Project, method: str) -> None:
    _stuck(project)
    done = _evoclaims(project, "run", method, "--trials", "2", "--time-limit", "8s")
    assert done.returncode == 0, done.stderr
    for seed, line in enumerate(done.stdout.splitlines()[-2:]):
        assert line.startswith(
            f"  seed {seed}: timeout after 0 environment steps: its batch had 8 s; more by --time-limit"
        )


@pytest.mark.parametrize("workers", [(), ("-n2",)], ids=["alone", "xdist"])
def test_a_run_goes_on_to_the_other_claims_and_says_whose_time_was_over(
    project: Project, workers: tuple[str, ...]
) -> None:
    _stuck(project)
    project.write(
        slow="verdict(trials('looping', on='parity').solves_every_level.in_most_trials())",
        supported="supported",
        better="verdict(trials('right', on='parity').mean_success > trials('looping', on='parity').mean_success)",
    )
    assert _evoclaims(project, "run", "right").returncode == 0  # it must not be short of time below
    done = project.run_apart("--claims-time-limit=8s", *workers)
    shown = " ".join("\n".join(done.outlines).split())
    worst = "10 of 10 trials of looping on parity ran out of time (seeds 0, 1, 2, 3, 4, 5, 6, 7, 8, 9)"
    assert "claims: 2 supported, 1 refuted" in shown
    assert shown.count(f"[worst rank: {worst}]") == 2
    assert done.ret == 1
