"""§5.2.1: what the paper says about the half-cheetah among obstacles (Figs. 7 and 8)."""

import pytest

from evoclaims import Outcome, claim, expected, third_look

FIRST, AUDIT = "2026-11-21 10:55", "2026-11-26"
"""When claims were first committed, before their trials; and when an audit added readings, after all of them."""

NOBODY_RUNS_YET = (
    "in 128,000 steps, over obstacles of 5 to 20 cm right before the start, no method has learnt to run: NEAT's "
    "champions flail (median reward -30), HyperNEAT's collect 26; longer trials take minutes a condition"
)


@claim(
    "O1",
    says="NEAT performs best at locomoting over obstacles of increasing height",
    where="§5.2.1, Fig. 7",
    line=380,
    read="more reward",
    since=FIRST,
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
                because="NEAT's champions and PPO's policies collect about the same; in the paper's plot NEAT is above",
            ),
        ),
    ],
)
def test_neat_is_best_over_obstacles(trials, verdict, other):
    neat = trials("neat", on="obstacles")
    rest = trials(other, on="obstacles")
    verdict.reading(
        "reward before control costs",
        neat.reward_before_costs > rest.reward_before_costs,
        because="the published environment charges the half-cheetah nothing",
        since=AUDIT,
    )
    verdict(neat.reward > rest.reward)


@claim(
    "O2",
    says="PPO performs much better in this task",
    where="§5.2.1, Fig. 7",
    line=374,
    read="more reward than HyperNEAT and CMA-ES",
    since=FIRST,
    smoke=None,
    because=NOBODY_RUNS_YET,
)
@pytest.mark.parametrize("other", ["hyperneat", "cma_es"])
def test_ppo_is_second_over_obstacles(trials, verdict, other):
    """Only "more" is asserted; how much more stands in docs/protocol.md, "Limbs and obstacles"."""
    ppo = trials("ppo", on="obstacles")
    rest = trials(other, on="obstacles")
    verdict.reading(
        "reward before control costs",
        ppo.reward_before_costs > rest.reward_before_costs,
        because="the published environment charges the half-cheetah nothing",
        since=AUDIT,
    )
    verdict(ppo.reward > rest.reward)


@claim(
    "O3",
    says="Policies learned by PPO are fast but bumpy, incurring the control cost penalty of this robot and often "
    "flipping it over",
    where="§5.2.1, Fig. 7",
    line=375,
    read="pays more, is upside-down more than NEAT",
    since=FIRST,
    smoke=None,
    because=NOBODY_RUNS_YET,
)
@expected(
    Outcome.REFUTED,
    because="PPO is upside-down for much of an episode, as the paper says; but NEAT pays the higher control cost",
)
def test_ppo_is_bumpy(trials, verdict):
    ppo = trials("ppo", on="obstacles")
    neat = trials("neat", on="obstacles")
    verdict.reading(
        "pays a tenth of its reward, is upside-down in a quarter of the steps",
        ppo.pays(0.1).in_most_trials() & ppo.is_overturned(0.25).in_most_trials(),
        because="the sentence compares PPO with nobody; often is read as a quarter of the steps",
        since=AUDIT,
    )
    verdict.reading(
        "is upside-down in more than half of the steps",
        ppo.pays(0.1).in_most_trials() & ppo.is_overturned(0.5).in_most_trials(),
        because="often is read as more than half of the steps",
        since=AUDIT,
    )
    verdict.reading(
        "is upside-down more than NEAT",
        ppo.overturned > neat.overturned,
        because="the caption of Fig. 7 compares the two, and names penalties without comparing them",
        since=AUDIT,
    )
    verdict((ppo.control_cost > neat.control_cost) & (ppo.overturned > neat.overturned))


@claim(
    "O4",
    says="For the medium-difficulty task, NEAT's performance drops while the performance of PPO remains unchanged",
    where="§5.2.1, Fig. 8",
    line=387,
    read="NEAT drops, PPO within 500",
    since=FIRST,
    smoke=None,
    because=NOBODY_RUNS_YET,
)
def test_medium_obstacles_hold_back_neat_alone(trials, verdict):
    neat, neat_medium = trials("neat", on="obstacles"), trials("neat", on="obstacles_medium")
    ppo, ppo_medium = trials("ppo", on="obstacles"), trials("ppo", on="obstacles_medium")
    verdict.reading(
        "PPO within 200",
        (neat.reward > neat_medium.reward) & ppo.reward.equivalent_to(ppo_medium.reward, margin=200),
        because="500 is most of what our PPO collects: 200 is a third of it",
        since=AUDIT,
    )
    verdict.reading(
        "NEAT drops",
        neat.reward > neat_medium.reward,
        because="the half about NEAT, with which the paper goes on: it has benefited from a curriculum",
        since=AUDIT,
    )
    # 500 is a seventh of what the published PPO collects, but most of what ours does (docs/protocol.md).
    verdict((neat.reward > neat_medium.reward) & ppo.reward.equivalent_to(ppo_medium.reward, margin=500))


@claim(
    "O5",
    says="For the high-difficulty task, however, PPO fails dramatically while NEAT's performance degrades more "
    "gracefully. ... PPO has gotten stuck at the first obstacle while NEAT overpasses the obstacles",
    where="§5.2.1, Fig. 8",
    line=389,
    read="PPO passes one at most, NEAT has more reward",
    since=FIRST,
    smoke=None,
    because=NOBODY_RUNS_YET,
)
@expected(
    Outcome.SMALLER,
    because="NEAT passes more obstacles, as the paper says, and PPO stops at the first or second in most trials; but "
    "NEAT collects less, since its control cost is higher",
)
def test_high_obstacles_stop_ppo(trials, verdict):
    neat = trials("neat", on="obstacles_high")
    ppo = trials("ppo", on="obstacles_high")
    verdict.reading(
        "PPO passes one at most, NEAT passes more",
        ppo.passes_at_most(1).stays() & (neat.obstacles_passed > ppo.obstacles_passed),
        because="the sentence names obstacles, not reward",
        since=AUDIT,
    )
    verdict.reading(
        "NEAT passes more obstacles",
        neat.obstacles_passed > ppo.obstacles_passed,
        because="stuck and overpassing side by side",
        since=AUDIT,
    )
    verdict(ppo.passes_at_most(1).stays() & (neat.reward > ppo.reward))


@claim(
    "O6",
    says="PPO learns to run more quickly at the cost of falling over and incurring penalties",
    where="§5.2.1, Fig. 7",
    line=380,
    read="further in a step than NEAT, and more upside-down",
    since=AUDIT,
    smoke=None,
    because=NOBODY_RUNS_YET,
)
@expected(Outcome.REFUTED, because="NEAT comes further in its episodes, since PPO stops on its back")
def test_ppo_runs_more_quickly_and_falls(trials, verdict):
    ppo, neat = trials("ppo", on="obstacles"), trials("neat", on="obstacles")
    verdict.reading(
        "further in a step than NEAT",
        ppo.speed > neat.speed,
        because="how quickly it runs, without what that costs",
        since=AUDIT,
    )
    verdict((ppo.speed > neat.speed) & (ppo.overturned > neat.overturned))


@claim(
    "O7",
    says="NEAT overpasses the obstacles yet primarily by flipping over",
    where="§5.2.1, Fig. 8",
    line=390,
    read="upside-down in more than half of the steps",
    since=AUDIT,
    smoke=None,
    because=NOBODY_RUNS_YET,
)
def test_neat_flips_over_high_obstacles(trials, verdict):
    neat = trials("neat", on="obstacles_high")
    verdict.reading(
        "upside-down in a quarter of the steps",
        (neat.obstacles_passed > 1) & neat.is_overturned(0.25).in_most_trials(),
        because="flipping over need not mean to stay there",
        since=AUDIT,
    )
    verdict((neat.obstacles_passed > 1) & neat.is_overturned(0.5).in_most_trials())


@third_look
@claim(
    "O8",
    says="[PPO] did not master the final level but progressed by flipping over",
    where="§5.2.1, Fig. 7",
    line=392,
    read="passes less than all, more than a third, upside-down in half of the steps",
    since=AUDIT,
    smoke=None,
    because=NOBODY_RUNS_YET,
)
def test_ppo_does_not_master_the_final_level(trials, verdict):
    ppo = trials("ppo", on="obstacles")
    progressed = ppo.passes_at_most(14).stays() & (ppo.obstacles_passed > 5)
    verdict.reading(
        "upside-down in a quarter of the steps",
        progressed & ppo.is_overturned(0.25).in_most_trials(),
        because="flipping over need not mean to stay there",
        since=AUDIT,
    )
    verdict(progressed & ppo.is_overturned(0.5).in_most_trials())


@claim(
    "O9",
    says="the absence of a curriculum renders the final level unsolvable",
    where="§5.2.1, Fig. 8",
    line=391,
    read="passes not all, and fewer than in the task with levels",
    since=AUDIT,
    smoke=None,
    because=NOBODY_RUNS_YET,
)
@pytest.mark.parametrize("method", ["neat", "ppo"])
def test_high_obstacles_are_unsolvable_alone(trials, verdict, method):
    levels, high = trials(method, on="obstacles"), trials(method, on="obstacles_high")
    verdict(high.passes_at_most(14).stays() & (levels.obstacles_passed > high.obstacles_passed))
