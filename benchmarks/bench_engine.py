"""Speed of the parts, by pytest-benchmark: `pytest benchmarks/bench_engine.py --benchmark-enable --benchmark-only`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evoclaims.judging.exact import rank_test
from evoclaims.trials import devices

devices.configure()

from evoclaims.trials.lanes import Lanes  # noqa: E402
from evoclaims.trials.result_codec import dump, parse  # noqa: E402
from evoclaims.trials.runner import run  # noqa: E402
from evoclaims.trials.store import Store  # noqa: E402
from reproductions.nisioti2025 import REPRODUCTION  # noqa: E402


@pytest.mark.parametrize("method", ["cma_es", "ppo", "random_search"])
@pytest.mark.parametrize("tier", ["smoke", "full"])
def test_one_step_of_one_trial(benchmark, method, tier):
    condition = REPRODUCTION.tier(tier).condition(method, "n_parity_direct")
    lanes = Lanes(condition, devices.choose("auto")[:1])
    state, steps = lanes.start([0], 1), 0

    def step() -> None:
        nonlocal state, steps
        steps += 1
        state, report = lanes.advance(state, steps, 1)
        if report.ended[0]:
            state, steps = lanes.start([0], 1), 0

    with devices.single_threaded_linear_algebra():
        step()
        benchmark.pedantic(step, rounds=20)


@pytest.mark.parametrize("n", [10, 50])
def test_exact_rank_test(benchmark, n):
    rng = np.random.default_rng(0)
    benchmark(rank_test, rng.integers(0, 8, n).astype(float).tolist(), rng.integers(0, 8, n).astype(float).tolist())


def test_reading_a_record(benchmark, tmp_path: Path):
    condition = REPRODUCTION.tier("smoke").condition("hand_built", "n_parity")
    result = run(condition, [0], Store(tmp_path / "store"), devices.choose("cpu"))[0]
    benchmark(parse, dump(result))
