"""Details that the paper leaves open, or that its code does differently: which conclusions depend on them?"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any, Literal

from evoclaims import Condition, Variant, changed
from evoclaims.envs import CumulativeParity, NParity, Obstacles, RobotTask, SimpleAlu
from evoclaims.methods import CmaEs, HandBuilt, HyperNeat, LevelTest, Neat, Ppo, SeldomDecomposedCmaEs
from evoclaims.networks import AllSkips, Mlp
from reproductions.nisioti2025 import ecorobot, stepping_gates, stones_details, submission
from reproductions.nisioti2025.first_level_ppo import FirstLevelPpo
from reproductions.nisioti2025.published_course import PublishedObstacles


def _rows_so_far(method: str, task: str, condition: Condition) -> Condition | None:
    """N-parity, with the rows of all levels so far."""
    asked = condition.task
    if not isinstance(asked, NParity) or condition.progression == "direct" or isinstance(condition.method, HandBuilt):
        return None
    return replace(condition, task=CumulativeParity(asked.bits, asked.sampling))


def _published_alu(method: str, task: str, condition: Condition) -> Condition | None:
    """Simple ALU, as in the published code."""
    asked = condition.task
    if not isinstance(asked, SimpleAlu) or isinstance(condition.method, HandBuilt):
        return None
    return replace(condition, task=replace(asked, operations="published_code", multiplexer="published_code"))


def _perceptron(method: str, task: str, condition: Condition) -> Condition | None:
    """CMA-ES with the published script's network; with smoke's robots a small one. Its gates have perceptrons.

    With 6 inputs and an output the script's network has 3,425 parameters.
    """
    trained: Any = condition.method
    if not isinstance(trained, CmaEs) or isinstance(trained.network, Mlp):
        return None
    if trained.network == AllSkips(hidden=24):
        return replace(condition, method=SeldomDecomposedCmaEs(trained.population, Mlp((32,) * 4)))
    return replace(condition, method=replace(trained, network=Mlp((8,) * 2)))


def _published_neat(method: str, task: str, condition: Condition) -> Condition | None:
    """NEAT with the published code's rates and handling of new levels; at full size also its population."""
    if not isinstance(condition.method, Neat):
        return None
    ours = condition.method.settings
    most = ours.species.most * 50 // 20 if isinstance(condition.task, RobotTask) else min(ours.species.most, 20)
    return _published_evolution(condition, min(ours.population, 1_024), most)


def _published_hyperneat(method: str, task: str, condition: Condition) -> Condition | None:
    """HyperNEAT with the published code's rates and handling of new levels; at full size also its population."""
    if not isinstance(condition.method, HyperNeat):
        return None
    ours = condition.method.settings
    size = ours.population // 2 if isinstance(condition.task, RobotTask) else min(ours.population, 1_024)
    return _published_evolution(condition, size, min(ours.species.most, 20))


def _published_evolution(condition: Condition, population: int, most: int) -> Condition:
    """Evolve so many genomes in at most so many species, which keep their records on a new level."""
    evolved: Any = condition.method
    ours = evolved.settings
    species = replace(ours.species, most=most, on_level_up="keep")
    settings = replace(ours, population=population, mutation=replace(ours.mutation, node_add=0.1), species=species)
    return replace(condition, method=replace(evolved, settings=settings))


def _narrow_substrate(method: str, task: str, condition: Condition) -> Condition | None:
    """HyperNEAT with 16 hidden neurons around the simplest robot, as in the published code; smoke has them anyhow."""
    evolved: Any = condition.method
    if not isinstance(evolved, HyperNeat) or evolved.substrate != ecorobot.simple_rob_substrate(hidden=32):
        return None
    return replace(condition, method=replace(evolved, substrate=ecorobot.simple_rob_substrate(hidden=16)))


def _largest_layer(method: str, task: str, condition: Condition) -> Condition | None:
    """HyperNEAT with places up to ± the largest layer in its layered substrates, as in the published code."""
    evolved: Any = condition.method
    if not isinstance(evolved, HyperNeat) or evolved.extent == "largest_layer":
        return None
    return replace(condition, method=replace(evolved, extent="largest_layer"))


def _sigmoid(method: str, task: str, condition: Condition) -> Condition | None:
    """HyperNEAT with only sigmoids in its CPPNs."""
    evolved: Any = condition.method
    if not isinstance(evolved, HyperNeat):
        return None
    settings = replace(evolved.settings, activations=("sigmoid",))
    return replace(condition, method=replace(evolved, settings=settings))


def _lucky_level_up(method: str, task: str, condition: Condition) -> Condition | None:
    """PPO moves up a level when its stochastic policy answers 128 random rows correctly, tested 49 times in a budget.

    The published code asks its deterministic policy.
    """
    learner: Any = condition.method
    if not isinstance(learner, Ppo) or isinstance(condition.task, RobotTask):
        return None
    test = LevelTest(every=max(1, condition.steps // 49), sampled_episodes=128)
    return replace(condition, method=replace(learner, level_test=test))


def _first_level(method: str, task: str, condition: Condition) -> Condition | None:
    """PPO never trains on a level after the first; only its test goes on."""
    learner: Any = condition.method
    if not isinstance(learner, Ppo) or isinstance(condition.task, RobotTask) or condition.progression == "direct":
        return None
    settings = {field.name: getattr(learner, field.name) for field in fields(learner)}
    return replace(condition, method=FirstLevelPpo(**settings))


def _whole_tables(method: str, task: str, condition: Condition) -> Condition | None:
    """PPO on 6-parity without the curriculum, with whole tables for episodes: a misspelt mode in the published code."""
    asked = condition.task
    if not isinstance(condition.method, Ppo) or not isinstance(asked, NParity) or condition.progression != "direct":
        return None
    return replace(condition, task=replace(asked, sampling="exhaustive"))


def _published_ppo(method: str, task: str, condition: Condition) -> Condition | None:
    """PPO on robots, with the published code's hyperparameters."""
    learner: Any = condition.method
    if not isinstance(learner, Ppo) or not isinstance(condition.task, RobotTask):
        return None
    return replace(condition, method=replace(learner, unroll_length=20, discounting=0.95, updates_per_batch=8))


def _published_course(method: str, task: str, condition: Condition) -> Condition | None:
    """Obstacles with the published code's boxes, reward and longer examination."""
    asked = condition.task
    if not isinstance(asked, Obstacles):
        return None
    return replace(condition, task=PublishedObstacles(episode_steps=asked.episode_steps, heights=asked.heights))


def _few_environments(method: str, task: str, condition: Condition) -> Condition | None:
    """PPO on robots, with a thirty-second of the environments, at least 8, and a quarter of the batch."""
    learner: Any = condition.method
    if not isinstance(learner, Ppo) or not isinstance(condition.task, RobotTask):
        return None
    fewer = replace(learner, environments=max(8, learner.environments // 32), batch_size=learner.batch_size // 4)
    return replace(condition, method=fewer)


def _published_value_network(method: str, task: str, condition: Condition) -> Condition | None:
    """PPO on robots, with a value network of one layer more than the policy's, eight times as wide.

    The same rule gives the gates' 7 layers of 32.
    """
    learner: Any = condition.method
    if not isinstance(learner, Ppo) or not isinstance(condition.task, RobotTask):
        return None
    width = 8 * learner.policy_layers[0]
    return replace(condition, method=replace(learner, value_layers=(width,) * (len(learner.policy_layers) + 1)))


def _published(method: str, task: str, condition: Condition) -> Condition | None:
    """What the published scripts do otherwise.

    With the curriculum they ask N-parity for the level's rows alone, as the paper's text has it.
    """
    now = condition
    for change in (
        _published_alu,
        _perceptron,
        _published_neat,
        _published_hyperneat,
        _narrow_substrate,
        _sigmoid,
        _first_level,
        _whole_tables,
        _published_ppo,
        _few_environments,
        _published_value_network,
        _published_course,
    ):
        now = change(method, task, now) or now
    return None if now is condition else now


def _published_rows_so_far(method: str, task: str, condition: Condition) -> Condition | None:
    """What the published scripts do otherwise on the gates; N-parity asks the rows of all levels so far, too."""
    if isinstance(condition.task, RobotTask):
        return None
    now = _rows_so_far(method, task, condition) or condition
    return _published(method, task, now) or (None if now is condition else now)


def _submission(pays: Literal["each", "once"], within: float) -> stones_details.Change:
    """Return the change to a member of `submission`; on the gates the members are one."""
    robots = submission.robots(pays, within, (_published_course, _perceptron, _published_value_network))

    def change(method: str, task: str, condition: Condition) -> Condition | None:
        if isinstance(condition.task, RobotTask):
            return robots(method, task, condition)
        now = condition
        for one in (_rows_so_far, _published_alu, _perceptron, _published_neat, submission.gates, _first_level):
            now = one(method, task, now) or now
        now = stones_details.other_ppo(frozen_noise=True)(method, task, now) or now
        return None if now is condition else now

    return change


def _variant(says: str, change: Any) -> Variant:
    """Apply a change to both tiers."""
    sizes = {
        "smoke": {**stepping_gates.SMOKE, **ecorobot.SMOKE},
        "full": {**stepping_gates.FULL, **ecorobot.FULL},
    }
    return Variant(says, {tier: changed(conditions, change) for tier, conditions in sizes.items()})


VARIANTS = {
    "rows_so_far": _variant(
        "N-parity asks the rows of all levels so far at every level, as a published environment does; the published "
        "scripts use that one without the curriculum alone",
        _rows_so_far,
    ),
    "published_alu": _variant(
        "Simple ALU as the published code has it: a multiplexer that ignores its select bit, XAX, no shift right",
        _published_alu,
    ),
    "perceptron": _variant(
        "CMA-ES trains a perceptron, in the published script of 4 x 32 neurons (at smoke 2 x 8)", _perceptron
    ),
    "published_neat": _variant(
        "NEAT adds nodes with probability 0.1, keeps old records on a new level, and has at most 1,024 genomes in 20 "
        "species, with robots in 50 (at smoke 10), as in the published code",
        _published_neat,
    ),
    "published_hyperneat": _variant(
        "HyperNEAT adds nodes to its CPPNs with probability 0.1, keeps old records on a new level, and has at most "
        "1,024 genomes in 20 species, with robots 512 (smoke: half), as in the published code",
        _published_hyperneat,
    ),
    "narrow_substrate": _variant(
        "HyperNEAT's networks have 16 hidden neurons around the simplest robot, as in the published code",
        _narrow_substrate,
    ),
    "largest_layer": _variant(
        "HyperNEAT's neurons for robots with limbs are at places up to ± the largest layer, as in the published code",
        _largest_layer,
    ),
    "sigmoid": _variant("HyperNEAT's CPPNs have sigmoids only, as in the published code", _sigmoid),
    "lucky_level_up": _variant(
        "PPO goes up a level when its stochastic policy answers 128 random rows right, in 49 tests; in the published "
        "code its deterministic one does",
        _lucky_level_up,
    ),
    "first_level": _variant(
        "PPO trains on the first level all along, and only its test goes up, as in the published code", _first_level
    ),
    "whole_tables": _variant(
        "PPO's episodes on 6-parity without the curriculum are whole tables, as in the published code", _whole_tables
    ),
    "published_ppo": _variant(
        "PPO with robots unrolls 20 steps, discounts by 0.95 and updates 8 times a batch, as in the published code",
        _published_ppo,
    ),
    "few_environments": _variant(
        "PPO with robots runs 128 environments and learns from batches of 512 trajectories, as in the published code "
        "(at smoke 8 and 8)",
        _few_environments,
    ),
    "published_value_network": _variant(
        "PPO's value network with robots has 5 layers of 256 neurons, as in the published code (at smoke 3 layers)",
        _published_value_network,
    ),
    "published_course": _variant(
        "Obstacles as in the published code: rough, hard boxes, no control cost, policies examined for 2,000 steps "
        "(at smoke 200)",
        _published_course,
    ),
    "published": _variant(
        "What the published scripts do otherwise, at once: every variant of one detail above but rows_so_far and "
        "lucky_level_up, which are not theirs, and largest_layer (nor their maze, where stones pay nothing)",
        _published,
    ),
    "published_rows_so_far": _variant(
        "The gates as under published, and N-parity asks the rows of all levels so far, with which NEAT's curve in "
        "Figure 3 comes out",
        _published_rows_so_far,
    ),
    "fixed_start": _variant(
        "Among stones every start is the same: an upper bound, which no commit of the authors has",
        stones_details.start_noise(0.0),
    ),
    "quarter_noise": _variant("Starts among stones have a quarter of the noise", stones_details.start_noise(0.25)),
    "half_noise": _variant("Starts among stones have half of the noise", stones_details.start_noise(0.5)),
    "common_starts": _variant(
        "CMA-ES with robots runs two episodes of each individual, from two starts that a generation shares",
        stones_details.common_starts,
    ),
    "one_start_map": _variant(
        "All of a trial's individuals of MAP-Elites have one start", stones_details.one_start_map
    ),
    "long_map": _variant(
        "MAP-Elites makes 50,000 iterations, fifty times as many; the table's 100 loops of 1,000 would be twice that",
        stones_details.long_map,
    ),
    "best_ever": _variant(
        "The champion of evolution with robots is the first whose training episode was the best of all generations",
        stones_details.best_ever,
    ),
    "pay_once": _variant(
        "Stones pay in the 999th of 1,000 steps alone (for all stones: 1,000)", stones_details.other_stones(pays="once")
    ),
    "within_0.32": _variant(
        "A stone counts from 0.32 m, where published stones are touched", stones_details.within(0.32)
    ),
    "within_0.5": _variant(
        "A stone counts from 0.5 m, as in a debugging step of the authors", stones_details.within(0.5)
    ),
    "after_next": _variant(
        "Reward among stones rises towards the stone after the next", stones_details.other_stones(toward="after_next")
    ),
    "metres": _variant("Ranges among stones are metres", stones_details.metres),
    "near_target": _variant(
        "Episodes among stones end 1.1 m from the target, for no bonus, crossed what may be",
        stones_details.other_stones(ends="near_target"),
    ),
    "walls_0.3": _variant("The stones' maze has walls of 0.6 m, not 0.2", stones_details.other_stones(walls=0.3)),
    "layered_16": _variant(
        "HyperNEAT's substrate for the simplest robot is layered, as for others, with 16 hidden neurons",
        stones_details.layered_16,
    ),
    "paper_time_budgets": _variant(
        "Robots are trained for as long as the scripts of April 2025 say", stones_details.paper_time_budgets
    ),
    "big_maze_ant": _variant("The ant crosses stones in a larger maze", stones_details.big_maze_ant),
    "torso_only": _variant("The ant among stones sees its torso's place, and no joint", stones_details.torso_only),
    "first_state": _variant(
        "Each of PPO's environments with robots returns to its own first state",
        stones_details.other_ppo(first_state=True),
    ),
    "kept_counters": _variant(
        "The same, and stones once crossed stay crossed when an episode ends",
        stones_details.other_ppo(first_state=True, kept_counters=True),
    ),
    "frozen_noise": _variant(
        "PPO is examined with noise, the same draw in every step", stones_details.other_ppo(frozen_noise=True)
    ),
    "easy_as_coded": _variant(
        "The easy maze shows the way to the target, pays metres, and has its rangefinders 3 m from the robot; "
        "examinations, and PPO's episodes, have 300 steps",
        stones_details.easy_as_coded,
    ),
    "recurrent_24": _variant(
        "CMA-ES among stones trains 24 neurons that feed each other five times a step and keep their state; its "
        "covariance is decomposed once a hundredth of it is new, as with the perceptron",
        stones_details.recurrent_24,
    ),
    "submission": _variant(
        "The protocol at the time of the paper; stones pay in every step and count from 0.32 m",
        _submission("each", 0.32),
    ),
    "submission_once": _variant("The same; stones pay once, and count from 0.32 m", _submission("once", 0.32)),
    "submission_0.5": _variant("The same; stones pay in every step, and count from 0.5 m", _submission("each", 0.5)),
    "submission_once_0.5": _variant("The same; stones pay once, and count from 0.5 m", _submission("once", 0.5)),
}
