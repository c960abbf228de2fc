"""Methods that never return: a loop in a program, a callback, and Python itself; each ends when its time is over."""

from __future__ import annotations

import os
import subprocess
import sys

from tiny_project import Project

from evoclaims.trials.store import Store

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


METHODS = {STUCK}
TIERS = {"smoke": Tier(conditions(1), Design.fixed(10)), "full": Tier(conditions(2), Design.fixed(10))}
REPRODUCTION = replace(REPRODUCTION, tiers=TIERS)
'''

COMMAND = "from evoclaims.cli import main; raise SystemExit(main())"


LIMIT = "2s"


def _stuck(project: Project, methods: str) -> None:
    paper = project.path / "tiny_paper.py"
    paper.write_text(paper.read_text() + STUCK.replace("{STUCK}", methods))


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


def test_the_command_ends_with_its_trials_timed_out(project: Project) -> None:
    """A loop in a program is in the test below: it keeps its device, so that a callback would never be called."""
    _stuck(project, "{'tracing': Tracing(), 'calling': Calling()}")
    done = _evoclaims(project, "run", "--on", "parity", "--trials", "2", "--time-limit", LIMIT)
    assert done.returncode == 0, done.stderr
    lines = [line for line in done.stdout.splitlines() if line.startswith("  seed")]
    assert len(lines) == 4
    for number, line in enumerate(lines):
        assert line.startswith(
            f"  seed {number % 2}: timeout after 0 environment steps: its batch had 2 s; more by --time-limit"
        )


def test_a_command_that_collects_claims_goes_on_after_trials_that_never_return(project: Project) -> None:
    """A run of pytest would end the process, since they still run in it."""
    _stuck(project, "{**METHODS, 'calling': Calling()}")
    project.write(slow="verdict(trials('calling', on='parity').solves_every_level.in_most_trials())", a="supported")
    settings = project.path / "pyproject.toml"
    settings.write_text(settings.read_text().replace("[tool.evoclaims]", f'[tool.evoclaims]\ntime_limit = "{LIMIT}"'))
    done = _evoclaims(project, "mutants", "--mutant=blind", "--device=cpu")
    assert "planted faults change a verdict" in done.stdout
    assert "slow cannot be judged: " in done.stderr
    assert (project.path / "mutants.toml").exists()


def test_a_run_goes_on_to_the_other_claims_and_says_whose_time_was_over(project: Project, stored: Store) -> None:
    """The trials of the right network are stored: it must not be short of time."""
    _stuck(project, "{**METHODS, 'looping': Looping()}")
    project.write(
        slow="verdict(trials('looping', on='parity').solves_every_level.in_most_trials())",
        supported="supported",
        better="verdict(trials('right', on='parity').mean_success > trials('looping', on='parity').mean_success)",
    )
    done = project.run_apart(f"--claims-time-limit={LIMIT}")
    shown = " ".join("\n".join(done.outlines).split())
    ended = "10 of 10 trials of looping on parity ran out of time (seeds 0, 1, 2, 3, 4, 5, 6, 7, 8, 9)"
    assert "claims: 1 supported, 2 inconclusive" in shown
    assert shown.count(f"{ended}; with other results of theirs") == 2
    assert done.ret == 0  # they decide nothing
