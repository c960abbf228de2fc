"""§5.2.1: what the paper says about the half-cheetah among obstacles (Figs. 7 and 8)."""

import pytest

from evoclaims import Outcome, claim, expected

NOBODY_RUNS_YET = (
    "in 128,000 steps, over obstacles of 5 to 20 cm right before the start, no method has learnt to run: NEAT's "
    "champions flail (median reward -30), HyperNEAT's collect 26; longer trials take minutes a condition"
)


@claim(
    "O1",
    says="NEAT performs best at locomoting over obstacles of increasing height",
    where="§5.2.1, Fig. 7",
    smoke=None,
    because=NOBODY_RUNS_YET,
)
@pytest.mark.parametrize(
    "other",
    [
        "hyperneat",
        "cma_es",
        pytest.param(
            "ppo",
            marks=expected(
                Outcome.INCONCLUSIVE,
                tier="full",
                because="NEAT's champions and PPO's policies collect about the same; in the paper's plot NEAT is above",
            ),
        ),
    ],
)
def test_neat_is_best_over_obstacles(trials, verdict, other):
    neat = trials("neat", on="obstacles")
    rest = trials(other, on="obstacles")
    verdict(neat.reward > rest.reward)


@claim(
    "O2",
    says="PPO performs much better in this task",
    where="§5.2.1, Fig. 7",
    smoke=None,
    because=NOBODY_RUNS_YET,
)
@pytest.mark.parametrize("other", ["hyperneat", "cma_es"])
def test_ppo_is_second_over_obstacles(trials, verdict, other):
    """Only "more" is asserted; how much more stands in docs/protocol.md, "Limbs and obstacles"."""
    ppo = trials("ppo", on="obstacles")
    rest = trials(other, on="obstacles")
    verdict(ppo.reward > rest.reward)


@claim(
    "O3",
    says="Policies learned by PPO are fast but bumpy, incurring the control cost penalty of this robot and often "
    "flipping it over",
    where="§5.2.1, Fig. 7",
    smoke=None,
    because=NOBODY_RUNS_YET,
)
@expected(
    Outcome.REFUTED,
    tier="full",
    because="PPO is upside-down for much of an episode, as the paper says; but NEAT pays the higher control cost",
)
def test_ppo_is_bumpy(trials, verdict):
    ppo = trials("ppo", on="obstacles")
    neat = trials("neat", on="obstacles")
    verdict((ppo.control_cost > neat.control_cost) & (ppo.overturned > neat.overturned))


@claim(
    "O4",
    says="For the medium-difficulty task, NEAT's performance drops while the performance of PPO remains unchanged",
    where="§5.2.1, Fig. 8",
    smoke=None,
    because=NOBODY_RUNS_YET,
)
def test_medium_obstacles_hold_back_neat_alone(trials, verdict):
    neat, neat_medium = trials("neat", on="obstacles"), trials("neat", on="obstacles_medium")
    ppo, ppo_medium = trials("ppo", on="obstacles"), trials("ppo", on="obstacles_medium")
    # 500 is a seventh of what the published PPO collects, but most of what ours does (docs/protocol.md).
    verdict((neat.reward > neat_medium.reward) & ppo.reward.equivalent_to(ppo_medium.reward, margin=500))


@claim(
    "O5",
    says="For the high-difficulty task, however, PPO fails dramatically while NEAT's performance degrades more "
    "gracefully. ... PPO has gotten stuck at the first obstacle while NEAT overpasses the obstacles",
    where="§5.2.1, Fig. 8",
    smoke=None,
    because=NOBODY_RUNS_YET,
)
@expected(
    Outcome.REFUTED,
    tier="full",
    because="NEAT passes more obstacles, and PPO stays at the first in most trials, as the paper says; but NEAT "
    "collects less, since its control cost is higher",
)
def test_high_obstacles_stop_ppo(trials, verdict):
    neat = trials("neat", on="obstacles_high")
    ppo = trials("ppo", on="obstacles_high")
    verdict(ppo.passes_at_most(1).stays() & (neat.reward > ppo.reward))
