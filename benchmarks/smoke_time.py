"""How long the smoke tier takes: cold, with a warm compilation cache, and with its trials stored.

    python benchmarks/smoke_time.py

Each run is a fresh pytest process from imports to verdicts. The floor of the cold run is XLA's compilation (the sum of
the conditions' compile seconds, printed below) and the trials' own steps.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from evoclaims.trials.store import Store

ROOT = Path(__file__).parent.parent


def seconds(storage: Path, cache: Path) -> float:
    """Run the smoke tier and return its time in seconds."""
    environment = {**os.environ, "XDG_CACHE_HOME": str(cache)}
    command = [sys.executable, "-m", "pytest", "-q", "-m", "smoke", "claims", f"--claims-storage={storage}"]
    began = time.perf_counter()
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    took = time.perf_counter() - began
    if "no verdicts" in done.stdout or "claims:" not in done.stdout:
        raise SystemExit(f"The smoke tier did not come to verdicts:\n{done.stdout}\n{done.stderr}")
    return took


def spent(storage: Path) -> tuple[float, float]:
    """Return the compile and run seconds of all batches in a store."""
    batches: dict[tuple[str, str], tuple[float, float]] = {}
    for trial in Store(storage).results([]):
        key = (trial.condition, str(trial.timing["started"]))
        compiled, ran = batches.get(key, (0.0, 0.0))
        batches[key] = max(compiled, trial.timing["compile"]), max(ran, trial.timing["run"])
    return sum(c for c, _ in batches.values()), sum(r for _, r in batches.values())


def main() -> None:
    """Measure the three runs and print them as a table."""
    with tempfile.TemporaryDirectory() as folder:
        cache, first, second = Path(folder) / "cache", Path(folder) / "first", Path(folder) / "second"
        cold, warm, stored = seconds(first, cache), seconds(second, cache), seconds(second, cache)
        for name, took, store in (("cold", cold, first), ("warm compilation cache", warm, second)):
            compiled, ran = spent(store)
            print(f"{name:<24}{took:7.1f} s  (compiling {compiled:.1f} s, trials {ran:.1f} s)")
        print(f"{'trials stored':<24}{stored:7.1f} s")
        print(f"warm / cold {warm / cold:.2f}, stored / cold {stored / cold:.2f}, cores {os.cpu_count()}")


if __name__ == "__main__":
    main()
