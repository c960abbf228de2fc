"""§5.2.1: what the paper says about the half-cheetah among obstacles (Figs. 7 and 8).

Smoke judges the sentences after a few generations of episodes of 100 steps, which end before the first obstacle.
"""

import pytest

from evoclaims import Outcome, claim, expected

HYPERNEAT_RUNS_AT_ONCE = expected(
    Outcome.REFUTED,
    tier="smoke",
    because="3 generations: the weights that HyperNEAT's first networks draw already run forward, mean reward 46; NEAT "
    "(-15) and PPO (5) have hardly begun",
)
PPO_HOLDS_STILL = expected(
    Outcome.REFUTED,
    tier="smoke",
    because="10,000 steps: PPO has learnt to hold still, which costs next to nothing (4 of control cost against NEAT's "
    "58); NEAT's champions of 3 generations flail",
)
TOO_EARLY_TO_TELL = expected(
    Outcome.REFUTED,
    tier="smoke",
    because="after 3 generations NEAT and CMA-ES are as good as their first networks: undecided with jax 0.10, "
    "supported with 0.11, refuted with 0.12",
)


@claim(
    "O1",
    says="NEAT performs best at locomoting over obstacles of increasing height",
    where="§5.2.1, Fig. 7",
    smoke="NEAT collects the most reward in 9,600 steps",
)
@pytest.mark.parametrize(
    "other",
    [
        pytest.param("hyperneat", marks=HYPERNEAT_RUNS_AT_ONCE),
        pytest.param("cma_es", marks=TOO_EARLY_TO_TELL),
        pytest.param("ppo", marks=PPO_HOLDS_STILL),
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
    smoke="PPO collects more reward in 10,000 steps than HyperNEAT and CMA-ES",
)
@pytest.mark.parametrize("other", [pytest.param("hyperneat", marks=HYPERNEAT_RUNS_AT_ONCE), "cma_es"])
def test_ppo_is_second_over_obstacles(trials, verdict, other):
    ppo = trials("ppo", on="obstacles")
    rest = trials(other, on="obstacles")
    verdict(ppo.reward > rest.reward)


@claim(
    "O3",
    says="Policies learned by PPO are fast but bumpy, incurring the control cost penalty of this robot and often "
    "flipping it over",
    where="§5.2.1, Fig. 7",
    smoke="After 10,000 steps PPO's policies pay more control cost than NEAT's, and flip the robot over more often",
)
@PPO_HOLDS_STILL
def test_ppo_is_bumpy(trials, verdict):
    ppo = trials("ppo", on="obstacles")
    neat = trials("neat", on="obstacles")
    verdict((ppo.control_cost > neat.control_cost) & (ppo.overturned > neat.overturned))


@claim(
    "O4",
    says="For the medium-difficulty task, NEAT's performance drops while the performance of PPO remains unchanged",
    where="§5.2.1, Fig. 8",
    smoke="On ground where the first obstacle is not reached yet, NEAT's and PPO's rewards do not depend on its height",
)
def test_medium_obstacles_hold_back_neat_alone(trials, verdict, claim_tier):
    neat, neat_medium = trials("neat", on="obstacles"), trials("neat", on="obstacles_medium")
    ppo, ppo_medium = trials("ppo", on="obstacles"), trials("ppo", on="obstacles_medium")
    unchanged = ppo.reward.equivalent_to(ppo_medium.reward, margin={"full": 500, "smoke": 50}[claim_tier])
    neat_s = {
        "full": neat.reward > neat_medium.reward,
        "smoke": neat.reward.equivalent_to(neat_medium.reward, margin=50),
    }
    verdict(neat_s[claim_tier] & unchanged)


@claim(
    "O5",
    says="For the high-difficulty task PPO fails dramatically while NEAT's performance degrades more gracefully: PPO "
    "has gotten stuck at the first obstacle while NEAT overpasses the obstacles",
    where="§5.2.1, Fig. 8",
    smoke="In 10,000 steps PPO passes no high obstacle, and NEAT collects more reward",
)
@PPO_HOLDS_STILL
def test_high_obstacles_stop_ppo(trials, verdict):
    neat = trials("neat", on="obstacles_high")
    ppo = trials("ppo", on="obstacles_high")
    verdict(ppo.passes_at_most(1).stays() & (neat.reward > ppo.reward))
