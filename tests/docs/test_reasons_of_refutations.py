"""Numbers in the reasons that claims give for their refutations are those of the committed trials."""

from __future__ import annotations

import re
import statistics
from pathlib import Path

import pytest

from evoclaims.paper.references import committed
from reproductions.nisioti2025 import REPRODUCTION

CLAIMS = Path(__file__).parents[2] / "claims"


def _text(name: str) -> str:
    """Return a claim file with the strings that go over several lines in one piece."""
    return re.sub(r'"\s*\n\s*f?"', "", (CLAIMS / f"test_{name}.py").read_text(encoding="utf-8"))


def _values(method: str, task: str, metric: str) -> list[float]:
    trials = committed(REPRODUCTION.references, "full", method, task)
    assert len(trials) == 10
    return [float(trial.metrics[metric]) for trial in trials]


def _hundreds(values: list[float]) -> str:
    """Return the range of rewards, to hundreds."""
    return f"{round(min(values), -2):,.0f} to {round(max(values), -2):,.0f}"


def _one_place(values: list[float]) -> str:
    return f"{min(values):.1f} to {max(values):.1f}"


@pytest.mark.parametrize(("who", "method"), [("CMA-ES", "cma_es"), ("PPO", "goal_ppo")])
def test_rewards_among_stones_that_neat_s_are_compared_with(who: str, method: str) -> None:
    assert f"{{LUCKY}}; {who}, {_hundreds(_values(method, 'stones', 'last_fitness'))}" in _text("stepping_stones")


def test_what_neat_collects_in_its_lucky_episode_and_in_others() -> None:
    trials = committed(REPRODUCTION.references, "full", "neat", "stones")
    lucky = [trial.curves["fitness"][-1] for trial in trials]
    others = _values("neat", "stones", "last_fitness")
    assert f"collects {_hundreds(lucky)}, ten others {_hundreds(others)} on average" in _text("stepping_stones")


def test_the_stones_that_cma_es_and_hyperneat_cross() -> None:
    text = _text("stepping_stones")
    crossed = _values("cma_es", "stones", "stones")
    beyond = sum(stones > 2 for stones in crossed)
    assert f"cross {_one_place(crossed)} stones (mean {statistics.mean(crossed):.1f}) in ten episodes" in text
    assert beyond == 1
    assert "in one trial more than two" in text
    crossed = _values("hyperneat", "stones", "stones")
    lucky = [trial.curves["fitness"][-1] for trial in committed(REPRODUCTION.references, "full", "hyperneat", "stones")]
    assert (
        f"one episode in training collects {_hundreds(lucky)} cross {_one_place(crossed)} stones "
        f"(mean {statistics.mean(crossed):.1f}) in ten other episodes"
    ) in text


def test_how_far_cma_es_gets_on_the_gates() -> None:
    past_xor = sum(level > 4 for level in _values("cma_es", "simple_alu", "furthest_solved"))
    solved = sum(share == 1 for share in _values("cma_es", "n_parity", "mean_success"))
    assert past_xor == 1
    assert f"{solved} of 10 solve 6-parity, one of 10 gets past XOR" in _text("stepping_gates")


def test_control_costs_and_falls_among_obstacles() -> None:
    cost = {method: _values(method, "obstacles", "control_cost") for method in ("neat", "ppo")}
    over = {method: _values(method, "obstacles", "upside_down") for method in ("neat", "ppo")}
    assert sum(share > 0.5 for share in over["neat"]) == 1
    least, most = 100 * min(over["ppo"]), max(over["ppo"])
    assert (
        f"PPO is upside-down for {least:.0f} to {most:.0%} of an episode, NEAT's champions for more than half in one "
        f"trial of ten; but their control costs {min(cost['neat']):.0f} to {max(cost['neat']):.0f}, PPO's "
        f"{min(cost['ppo']):.0f} to {max(cost['ppo']):.0f}"
    ) in _text("obstacles")
