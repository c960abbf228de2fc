"""Hand-written tables in docs/protocol.md and readings.md are what the committed trials and conditions give."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evoclaims.judging.effect import a12
from evoclaims.judging.exact import rank_test
from evoclaims.judging.kinds.greater import GreaterTests
from evoclaims.judging.verdict import Outcome
from evoclaims.paper.references import champion_of, committed
from evoclaims.trials.champion_replay import unpacked
from evoclaims.trials.result import TrialResult
from reproductions.nisioti2025 import REPRODUCTION
from reproductions.nisioti2025.null_agents import no_action

PROTOCOL = (Path(__file__).parents[2] / "docs" / "protocol.md").read_text(encoding="utf-8")
SAID = " ".join(PROTOCOL.split())
READINGS = (Path(__file__).parents[2] / "docs" / "readings.md").read_text(encoding="utf-8")
NAMES = {"neat": "NEAT", "map_elites": "MAP-Elites", "cma_es": "CMA-ES", "hyperneat": "HyperNEAT", "ppo": "PPO"}
Reward = Callable[[TrialResult], float]


def _of_training(trial: TrialResult) -> float:
    return float(trial.curves["fitness"][-1])


def _examined(trial: TrialResult) -> float:
    return float(trial.metrics["last_fitness"])


def _without_cost(trial: TrialResult) -> float:
    return _examined(trial) + float(trial.metrics["control_cost"])


def _rewards(method: str, task: str, reward: Reward) -> list[float]:
    trials = committed(REPRODUCTION.references, "full", method, task)
    assert len(trials) in (10, 30)
    return [reward(trial) for trial in trials]


def _judged(method: str, task: str, reward: Reward) -> list[float]:
    """Return the rewards of the ten trials a side by which the claims about obstacles are judged."""
    return _rewards(method, task, reward)[:10]


def _line(cells: Sequence[str]) -> str:
    """Return a line of a table; an empty cell is one space."""
    return "\n|" + "".join(f" {cell} |" if cell else " |" for cell in cells) + "\n"


def _higher(a: Sequence[float], b: Sequence[float]) -> str:
    """Return how often A is above B, and the p of its being no higher."""
    return f"{a12(a, b):.2f}, p = {rank_test(a, b).p:.2g}"


@pytest.mark.parametrize("method", ["neat", "map_elites", "cma_es", "hyperneat"])
def test_rewards_among_stones_in_training_and_after_it_are_those_of_the_trials(method: str) -> None:
    cells = [NAMES[method]]
    for reward in (_of_training, _examined):
        values = _rewards(method, "stones", reward)
        cells.append(f"{statistics.mean(values):,.0f} ± {statistics.stdev(values):.0f}")
        cells.append("" if method == "neat" else _higher(_rewards("neat", "stones", reward), values))
    assert _line(cells) in PROTOCOL


@pytest.mark.parametrize(
    ("part", "one", "other", "task"),
    [
        (r"O1\[hyperneat\]: NEAT above HyperNEAT", "neat", "hyperneat", "obstacles"),
        (r"O1\[cma\_es\]: NEAT above CMA-ES", "neat", "cma_es", "obstacles"),
        (r"O1\[ppo\]: NEAT above PPO", "neat", "ppo", "obstacles"),
        (r"O2\[hyperneat\]: PPO above HyperNEAT", "ppo", "hyperneat", "obstacles"),
        (r"O2\[cma\_es\]: PPO above CMA-ES", "ppo", "cma_es", "obstacles"),
        ("O5: NEAT above PPO, high obstacles", "neat", "ppo", "obstacles_high"),
    ],
)
def test_comparisons_with_the_control_cost_given_back_are_those_of_the_trials(
    part: str, one: str, other: str, task: str
) -> None:
    found = (_higher(_judged(one, task, reward), _judged(other, task, reward)) for reward in (_examined, _without_cost))
    assert f"| {part} | {' | '.join(f'A12 {text}' for text in found)} |" in PROTOCOL


def test_without_the_control_cost_ppo_would_not_be_above_cma_es() -> None:
    ppo, cma_es = (_judged(method, "obstacles", _without_cost) for method in ("ppo", "cma_es"))
    tests = GreaterTests(ppo, cma_es, REPRODUCTION.tiers["full"].design.a12_margin)
    told = f"PPO is as high in {tests.wins:.2f} of all pairs, p = {tests.smaller.p:.2g})"
    assert tests.p.outcome(REPRODUCTION.tiers["full"].design.last.alpha) is Outcome.SMALLER
    assert told in SAID


@pytest.mark.parametrize(
    ("variant", "method", "numbers", "said", "plot"),
    [
        ("", "ppo", (10, 30), "the protocol", ""),
        ("published_ppo", "ppo", (10, 30), "`published_ppo`: unroll, discount, updates", ""),
        ("published_value_network", "ppo", (10, 30), "`published_value_network`", ""),
        ("few_environments", "ppo", (10, 30), "`few_environments`", ""),
        ("published_course", "ppo", (10, 30), "`published_course` (2,000 steps, no cost)", ""),
        ("published", "ppo", (10, 30), "`published`: all of these", ""),
        ("published", "neat", (10,), "NEAT, ten trials", "4,250 ± 115"),
        ("published", "cma_es", (5,), "CMA-ES, five trials", "2,350 ± 150"),
        ("published", "ppo", (10,), "PPO, ten trials", "3,540 ± 340"),
    ],
)
def test_rewards_among_obstacles_by_setting_are_those_of_the_trials(
    variant: str, method: str, numbers: tuple[int, ...], said: str, plot: str
) -> None:
    trials = committed(REPRODUCTION.references_of(variant), "full", method, "obstacles")
    rewards = [_examined(trial) for trial in trials]
    passed = statistics.mean(float(trial.metrics["obstacles"]) for trial in trials)
    assert len(trials) in numbers
    cells = [said, f"{statistics.mean(rewards):,.0f}", f"{min(rewards):,.0f}, {max(rewards):,.0f}", f"{passed:.1f}"]
    assert _line([*cells, plot] if plot else cells) in PROTOCOL


def test_no_genome_among_obstacles_earns_what_would_end_the_published_run() -> None:
    trials = committed(REPRODUCTION.references_of("published"), "full", "neat", "obstacles")
    most = max(max(trial.curves["fitness"]) for trial in trials)
    assert f"more than {most:,.0f} in one" in SAID


def test_comparisons_among_obstacles_with_all_published_settings_are_those_of_the_trials() -> None:
    of = REPRODUCTION.references_of("published")
    trials = {method: committed(of, "full", method, "obstacles") for method in ("neat", "cma_es", "ppo")}
    rewards = {method: [_examined(trial) for trial in those] for method, those in trials.items()}
    assert f"(NEAT above PPO: A12 {a12(rewards['neat'], rewards['ppo']):.2f})" in SAID
    assert f"not above CMA-ES either (A12 {a12(rewards['neat'], rewards['cma_es']):.2f};" in SAID
    ppo, neat = (statistics.mean(float(trial.metrics["effort"]) for trial in trials[name]) for name in ("ppo", "neat"))
    assert f"{ppo:,.0f} and {neat:,.0f} an episode" in SAID


def test_how_many_archives_have_an_elite_at_the_target_is_that_of_the_committed_maps() -> None:
    """The event that trials record asks for all stones besides."""
    trials = committed(REPRODUCTION.references, "full", "map_elites", "stones")
    condition = REPRODUCTION.tiers["full"].conditions["map_elites", "stones"]
    task: Any = condition.task
    (west, east), (south, north) = task.area
    method: Any = condition.method
    across, up = method.cells
    cell = int((task.target[0] - west) / (east - west) * across), int((task.target[1] - south) / (north - south) * up)
    found = []
    for trial in trials:
        arrays = champion_of(REPRODUCTION.references, "full", trial)
        assert arrays is not None
        found.append(unpacked(arrays, condition, trial)[1][cell])
    there = sorted(float(reward) for reward in found if np.isfinite(reward))
    idle = no_action(condition)
    assert idle is not None
    assert (len(there), len(trials)) == (2, 30)
    assert f"in two trials of thirty at the target (with {there[0]:.0f} and {there[1]:.0f}, less than an idle" in SAID
    assert f"robot's {idle['metrics']['last_fitness']:.0f}), none with all stones" in SAID
    assert not any(trial.curves["reached"][-1] for trial in trials)


@pytest.mark.parametrize("method", NAMES)
def test_training_lengths_are_those_of_the_conditions(method: str) -> None:
    cells = [NAMES[method]]
    conditions = REPRODUCTION.tiers["full"].conditions
    for tasks in (
        ("n_parity", "n_parity_direct"),
        ("simple_alu",),
        ("stones", "stones_ant"),
        ("obstacles", "obstacles_medium", "obstacles_high"),
        ("deceptive_maze_easy", "deceptive_maze_easy_ant", "deceptive_maze_difficult"),
    ):
        found = {conditions[method, task] for task in tasks if (method, task) in conditions}
        lengths = {(one.environment_steps, "" if method == "ppo" else f" ({one.steps:,})") for one in found}
        assert len(lengths) <= 1
        cells += [f"{steps / 1e6:,.0f}{generations}" for steps, generations in lengths] or [""]
    assert _line(cells) in PROTOCOL


def test_rewards_of_neat_with_the_published_settings_are_those_of_its_trials() -> None:
    trials = committed(REPRODUCTION.references_of("published_neat"), "full", "neat", "stones")
    rewards = {reward: [reward(trial) for trial in trials] for reward in (_of_training, _examined)}
    earned = (f"{statistics.mean(values):,.0f} ± {statistics.stdev(values):,.0f}" for values in rewards.values())
    assert len(trials) in (10, 30)
    assert "{} in training and {} afterwards".format(*earned) in SAID
    assert f"(A12 {a12(rewards[_examined], _rewards('cma_es', 'stones', _examined)):.2f};" in SAID
    for method in ("cma_es", "map_elites", "hyperneat"):
        assert f"({_higher(rewards[_of_training], _rewards(method, 'stones', _of_training))})" in SAID


@pytest.mark.parametrize(
    ("variant", "method", "task"),
    [
        ("published_rows_so_far", "neat", "n_parity"),
        ("published_rows_so_far", "hyperneat", "n_parity"),
        ("published_rows_so_far", "ppo", "n_parity"),
        ("published", "hyperneat", "n_parity"),
        ("published", "cma_es", "simple_alu"),
        ("lucky_level_up", "ppo", "n_parity"),
        ("first_level", "ppo", "n_parity"),
        ("rows_so_far", "ppo", "n_parity"),
        ("", "ppo", "n_parity"),
        ("", "cma_es", "n_parity"),
        ("rows_so_far", "neat", "n_parity"),
        ("sigmoid", "hyperneat", "n_parity"),
    ],
)
def test_success_by_level_is_the_mean_of_the_trials(variant: str, method: str, task: str) -> None:
    trials = committed(REPRODUCTION.references_of(variant), "full", method, task)
    levels = zip(*(trial.levels["success"] for trial in trials), strict=True)
    assert len(trials) in (10, 30)
    assert " ".join(f"{statistics.mean(level):.2f}" for level in levels) in SAID


@pytest.mark.parametrize(
    ("heading", "method", "task"),
    [
        ("half-cheetah, plain ground", "ppo", "locomotion_half_cheetah"),
        ("obstacles of rising height", "ppo", "obstacles"),
        ("all high", "ppo", "obstacles_high"),
        ("stones", "ppo", "stones"),
        ("stones, shown the goal", "goal_ppo", "stones"),
        ("stones, the ant", "ppo", "stones_ant"),
        ("easy deceptive maze", "ppo", "deceptive_maze_easy"),
    ],
)
def test_rewards_of_ppo_with_either_value_network_are_those_of_the_trials(heading: str, method: str, task: str) -> None:
    places = 2 if task == "deceptive_maze_easy" else 0
    cells = [heading]
    for references in (REPRODUCTION.references, REPRODUCTION.references_of("published_value_network")):
        trials = committed(references, "full", method, task)
        rewards = [_examined(trial) for trial in trials]
        assert len(trials) in (10, 30)
        cell = f"{statistics.mean(rewards):,.{places}f} ± {statistics.stdev(rewards):,.{places}f}"
        if "stones" in task:
            cell += f" ({statistics.mean(float(trial.metrics['stones']) for trial in trials):.2f} stones)"
        cells.append(cell)
    assert _line(cells) in PROTOCOL


@pytest.mark.parametrize("variant", ["", "published_neat"])
def test_success_of_the_policies_saved_when_a_level_was_solved_is_that_of_the_trials(variant: str) -> None:
    """A level that was solved counts 1, others as the final policy leaves them."""
    trials = committed(REPRODUCTION.references_of(variant), "full", "neat", "n_parity")
    levels = zip(
        *(
            [
                1.0 if solved >= 0 else success
                for solved, success in zip(trial.levels["solved_at"], trial.levels["success"], strict=True)
            ]
            for trial in trials
        ),
        strict=True,
    )
    assert " ".join(f"{statistics.mean(level):.2f}" for level in levels) in SAID


def test_direct_encodings_on_average_over_levels_of_simple_alu_are_those_of_the_trials() -> None:
    def means(method: str) -> list[float]:
        trials = committed(REPRODUCTION.references, "full", method, "simple_alu")
        return [statistics.mean(trial.levels["success"]) for trial in trials]

    neat, cma_es = (a12(means(method), means("hyperneat")) for method in ("neat", "cma_es"))
    assert f"on Simple ALU NEAT's A12 against HyperNEAT is {neat:.2f}, CMA-ES's {cma_es:.2f}" in READINGS


def test_how_many_neurons_of_a_champion_lie_between_inputs_and_outputs_is_that_of_the_committed_ones() -> None:
    task = REPRODUCTION.tiers["full"].conditions["neat", "stones"].task
    ends = task.observation_size + task.action_size
    neurons, between, connections = [], [], []
    for trial in committed(REPRODUCTION.references, "full", "neat", "stones"):
        arrays = champion_of(REPRODUCTION.references, "full", trial)
        if arrays is None:
            continue
        keys = arrays[".nodes.key"][: int(arrays[".node_count"])]
        places = arrays[".connections.source"], arrays[".connections.target"]
        links = [*zip(*(place[: int(arrays[".connection_count"])].tolist() for place in places), strict=True)]
        fed, feeding = set(np.flatnonzero(keys < task.observation_size)), set(np.flatnonzero(keys < ends))
        feeding -= fed
        for _ in keys:
            fed |= {target for source, target in links if source in fed}
            feeding |= {source for source, target in links if target in feeding}
        neurons.append(len(keys) - ends)
        between.append(sum(bool(keys[slot] >= ends) for slot in fed & feeding))
        connections.append(sum(source in fed and target in feeding for source, target in links))
    half = sum(count <= ends for count in between)
    assert f"of the {len(between)} committed champions of the maze {min(between)} to {max(between)} hidden" in READINGS
    assert f"(median {statistics.median(between):g}) of {min(neurons)} to {max(neurons)}, with" in READINGS
    assert f"{min(connections)} to {max(connections)} connections, and in {half} of {len(between)} at most" in READINGS


def test_obstacles_passed_with_levels_and_without_them_are_those_of_the_trials() -> None:
    def passed(method: str, task: str) -> list[float]:
        return [float(t.metrics["obstacles"]) for t in committed(REPRODUCTION.references, "full", method, task)]

    neat, ppo = (
        [statistics.mean(passed(method, task)) for task in ("obstacles_high", "obstacles")]
        for method in ("neat", "ppo")
    )
    assert f"NEAT passes {neat[0]:.1f} of fifteen without levels; with levels it passes {neat[1]:.1f}" in READINGS
    assert f"PPO passes {ppo[0]:.1f} without levels, and with them {ppo[1]:.1f}, so" in READINGS
    assert [max(passed(method, "obstacles")) == 15 for method in ("neat", "ppo")] == [True, False]
    assert passed("neat", "obstacles").count(15) == 1


def test_what_is_left_of_the_reward_of_the_episode_that_made_a_champion_is_that_of_the_trials() -> None:
    def left(method: str) -> str:
        trials = committed(REPRODUCTION.references, "full", method, "stones")
        shares = [100 * _examined(trial) / _of_training(trial) for trial in trials]
        return f"{min(shares):.0f} to {max(shares):.0f}%"

    assert f"HyperNEAT's last champions collect {left('hyperneat')} of what they had" in SAID
    assert f"made them champions, NEAT's {left('neat')} (" in SAID


@pytest.mark.parametrize(
    ("variant", "said"), [("", "6-parity ({} on average)"), ("whole_tables", "published mode, none of ten is ({})")]
)
def test_success_of_ppo_without_the_curriculum_is_that_of_the_trials(variant: str, said: str) -> None:
    trials = committed(REPRODUCTION.references_of(variant), "full", "ppo", "n_parity_direct")
    mean = statistics.mean(float(trial.metrics["last_success"]) for trial in trials)
    assert said.format(f"{mean:.2f}") in SAID


def test_how_many_verdicts_the_published_value_network_touches_is_that_of_the_table() -> None:
    lines = [line.strip("| ").split(" | ") for line in PROTOCOL.splitlines() if line.startswith("| ")]
    head = next(cells for cells in lines if cells[:3] == ["claim", "tier", "the protocol"])
    column = head.index(r"published\_value\_network")
    cells = [cells[column] for cells in lines if len(cells) == len(head) and cells[1] == "full"]
    judged = [cell for cell in cells if cell != "–"]
    assert sum(cell.startswith("**") for cell in judged) == 4
    assert f"of {len(judged)} verdicts, four differ" in PROTOCOL
