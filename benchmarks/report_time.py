"""How long `evoclaims report` takes over 100,000 stored trials, every one of which some claim looks at.

    python benchmarks/report_time.py [--trials 100000] [--keep FOLDER]

The trials are synthetic: sound, sealed records with curves of 50 points, under a temporary project whose 1000 claims
look at 100 trials each, as many as the exact tests take (`--few`: at 10, so that most of the store is not needed).
"""

from __future__ import annotations

import argparse
import math
import resource
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.trials.result import TrialResult, digest
from evoclaims.trials.result_codec import dump
from evoclaims.trials.spec import Budget, Condition, TrialSpec
from evoclaims.trials.store import Store

CONDITIONS, POINTS = 1000, 50

PYPROJECT = """
[tool.evoclaims]
reproduction = "many_trials"
"""

REPRODUCTION = '''
"""Conditions that differ in their budgets alone."""
from pathlib import Path

from evoclaims.envs.gates.parity import NParity
from evoclaims.judging.design import Design
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.paper.reproduction import Reproduction, Tier
from evoclaims.trials.spec import Budget
from evoclaims.trials.spec import Condition

CONDITIONS = {{
    ("right", f"parity_{{i}}"): Condition(HandBuilt(), NParity(3), "curriculum", Budget(generations=i + 1))
    for i in range({conditions})
}}
REPRODUCTION = Reproduction(
    "many",
    "Many Trials",
    Path(__file__).parent,
    {{"smoke": Tier(CONDITIONS, Design.fixed(10)), "full": Tier(CONDITIONS, Design.fixed({trials}))}},
)
'''

CLAIMS = """
import pytest
from evoclaims import claim

@claim("T1", says="It solves every level", where="§1", smoke="It solves every level in small")
@pytest.mark.parametrize("task", [f"parity_{{i}}" for i in range({conditions})])
def test_it_solves_every_level(trials, verdict, task):
    verdict(trials("right", on=task).solves_every_level.in_most_trials())
"""


def record(condition: Condition, seed: int) -> TrialResult:
    """Return a sound record with numbers that depend on the seed."""
    spec = TrialSpec(condition, seed)
    value = 1.0 if seed % 5 else 0.5
    metrics = {"mean_success": value, "last_success": value, "furthest_solved": 1.0, "environment_steps": 6400.0}
    levels = {"success": (value,) * condition.task.levels}
    curves = {
        "steps": tuple(float(i + 1) for i in range(POINTS)),
        "environment_steps": tuple(128.0 * (i + 1) for i in range(POINTS)),
        "fitness": tuple(-math.exp(-0.1 * i) * (1 + 0.1 * math.sin(seed + i)) for i in range(POINTS)),
        "success": tuple(min(1.0, value * i / 20) for i in range(POINTS)),
        "level": tuple(float(i // 25) for i in range(POINTS)),
    }
    return TrialResult(
        id=spec.id,
        condition=condition.id,
        spec=spec.plain,
        seed=seed,
        status="done",
        metrics=metrics,
        levels=levels,
        curves=curves,
        digest=digest("done", metrics, levels, curves, b""),
        timing={"run": 1.0, "compile": 1.0, "batch": 1},
        provenance={"device": {"platform": "cpu", "kind": "cpu", "count": 1}, "git": {"sha": "0" * 40, "dirty": False}},
    )


def fill(store: Store, index: int, trials: int) -> None:
    """Write the records of one condition."""
    condition = Condition(HandBuilt(), NParity(3), "curriculum", Budget(generations=index + 1))
    for seed in range(trials):
        result = record(condition, seed)
        path = store.home(result)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(dump(result))


def cpu_seconds() -> float:
    """Return what ended child processes have computed for."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main() -> None:
    """Make the store, build the report, and print the seconds and the sizes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=100_000, help="records in the store (100000)")
    parser.add_argument("--few", action="store_true", help="claims look at 10 trials each")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="make the project there, and leave it")
    options = parser.parse_args()
    each = options.trials // CONDITIONS
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.keep or Path(temporary)
        (folder / "claims").mkdir(parents=True, exist_ok=True)
        looked = 10 if options.few else each
        (folder / "pyproject.toml").write_text(PYPROJECT)
        (folder / "many_trials.py").write_text(REPRODUCTION.format(conditions=CONDITIONS, trials=looked))
        (folder / "claims" / "test_many.py").write_text(CLAIMS.format(conditions=CONDITIONS))
        store = Store(folder / ".evoclaims")
        began = time.perf_counter()
        if not store.root.exists():
            with ProcessPoolExecutor() as pool:
                list(pool.map(fill, [store] * CONDITIONS, range(CONDITIONS), [each] * CONDITIONS))
        print(f"store of {CONDITIONS * each} records: {time.perf_counter() - began:.1f} s", flush=True)
        for command in ("status --tier full", "report --tier full"):
            began, spent = time.perf_counter(), cpu_seconds()
            arguments = [sys.executable, "-c", "import sys; from evoclaims.cli import main; sys.exit(main())"]
            subprocess.run([*arguments, *command.split()], cwd=folder, check=False, stdout=subprocess.DEVNULL)
            took, used = time.perf_counter() - began, cpu_seconds() - spent
            print(f"evoclaims {command}: {took:.1f} s, CPU {used:.1f} s ({looked} trials a claim)", flush=True)
        print(f"page: {(folder / 'report' / 'index.html').stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
