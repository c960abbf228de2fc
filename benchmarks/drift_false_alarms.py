"""How often the drift check is wrong where nothing changed, and conditions vary together.

Five conditions of one method have ten new trials and ten earlier ones each, of normal values. Values of one seed and
side correlate between conditions, as they do where trials share random numbers. Trials of one seed are exchanged
together. "Apart" names the seeds of each condition otherwise, so that each condition is exchanged for itself.

    python benchmarks/drift_false_alarms.py [CORRELATION] [RUNS]

docs/judging.md has the results.
"""

from __future__ import annotations

import sys

import numpy as np
from numpy.typing import NDArray

from evoclaims.judging.drift import DriftCase, check_drift
from evoclaims.trials.result import TrialResult

CONDITIONS, TRIALS = 5, 10


def main() -> None:
    """Print in how many runs a drift is found, with seeds exchanged together and apart."""
    given = [*sys.argv[1:], *("0.9", "400")[len(sys.argv) - 1 :]]
    correlation, runs = float(given[0]), int(given[1])
    draw, found = np.random.default_rng(20251127), {"together": 0, "apart": 0}
    for _ in range(runs):
        shared = draw.standard_normal((2 * TRIALS, 1)) * correlation**0.5
        values = shared + draw.standard_normal((2 * TRIALS, CONDITIONS)) * (1 - correlation) ** 0.5
        for way in found:
            found[way] += check_drift([_case(at, column, way) for at, column in enumerate(values.T)]).drifted
    for way, count in found.items():
        print(f"seeds exchanged {way}: {count} of {runs} runs drifted ({count / runs:.2%})")


def _case(at: int, values: NDArray[np.float64], way: str) -> DriftCase:
    first = 1_000 * at if way == "apart" else 0
    trials = tuple(_trial(first + number, float(value)) for number, value in enumerate(values))
    return DriftCase(f"condition {at}", "same", trials[:TRIALS], trials[TRIALS:], ("reward",), method="one")


def _trial(seed: int, reward: float) -> TrialResult:
    return TrialResult(f"{seed}", "same", {}, seed, "done", {"reward": reward}, {}, {}, f"{seed} {reward}", {}, {})


if __name__ == "__main__":
    main()
