"""§5.2.2 and §5.2.3: what the paper says about the ant, and about the deceptive mazes (Figs. 9 and 10)."""

import pytest

from evoclaims import Outcome, claim, expected


@claim(
    "M1",
    says="The robot controlled by NEAT reaches only the first stepping stone in the maze",
    where="§5.2.2, Fig. 9",
    smoke="After 3 generations the ant controlled by NEAT reaches no more than the first stepping stone",
)
def test_the_ant_stays_at_the_first_stone(trials, verdict):
    neat = trials("neat", on="stones_ant")
    verdict(neat.crosses_at_most(1).stays())


@claim(
    "M2",
    says="NEAT can no longer progress in the maze with stepping stones (contrast with Figure 5)",
    where="§5.2.2, Fig. 9",
    smoke="After 3 generations the ant controlled by NEAT reaches no more stones than the simplest robot after 8",
)
def test_the_ant_is_far_below_the_simplest_robot(trials, verdict, claim_tier):
    ant = trials("neat", on="stones_ant")
    simple = trials("neat", on="stones")
    alike = ant.stones.equivalent_to(simple.stones, margin=1.0)
    verdict({"full": ant.stones < simple.stones, "smoke": alike}[claim_tier])


@claim(
    "D1",
    says="In a simplified version of the deceptive maze HyperNEAT is able to avoid the local optimum and reach the "
    "target",
    where="§5.2.3, Fig. 10",
    smoke="In 8 generations of episodes too short to get there HyperNEAT does not reach the target",
)
@expected(
    Outcome.REFUTED,
    tier="full",
    because="eight trials of ten stay in the local optimum, 0.9 m from the target; two reach it in six episodes of ten",
)
def test_hyperneat_escapes_the_local_optimum(trials, verdict, claim_tier):
    hyperneat = trials("hyperneat", on="deceptive_maze_easy")
    says = {"full": hyperneat.reaches_the_target, "smoke": hyperneat.never_reaches_the_target}[claim_tier]
    verdict(says.in_most_trials())


@claim(
    "D2",
    says="PPO remains stuck at the nearby wall",
    where="§5.2.3, Fig. 10",
    smoke="After 50,000 steps PPO does not reach the target, and ends less than 4 m from it",
)
def test_ppo_stays_at_the_wall(trials, verdict, claim_tier):
    ppo = trials("ppo", on="deceptive_maze_easy")
    near = {"full": 2.0, "smoke": 4.0}[claim_tier]
    verdict(ppo.never_reaches_the_target.stays() & ppo.ends_within(near).in_most_trials())


@claim(
    "D3",
    says="This ability of HyperNEAT disappears when we replace the simple morphology with the ant robot",
    where="§5.2.3, Fig. 10",
    smoke="In 3 generations the ant controlled by HyperNEAT does not reach the target",
)
def test_the_ant_does_not_escape(trials, verdict):
    hyperneat = trials("hyperneat", on="deceptive_maze_easy_ant")
    verdict(hyperneat.never_reaches_the_target.stays())


@claim(
    "D4",
    says="MAP-Elites finds the target of the classical deceptive task, where HyperNEAT fails",
    where="§5.2.1, §5.2.3, Figs. 6 and 10",
    smoke="In 8 generations HyperNEAT does not reach the target of the difficult deceptive maze",
)
@expected(
    Outcome.REFUTED,
    tier="full",
    because="HyperNEAT fails, but MAP-Elites, too, has found the target in three trials of ten only (see S7)",
)
def test_hyperneat_fails_in_the_difficult_maze(trials, verdict, claim_tier):
    hyperneat = trials("hyperneat", on="deceptive_maze_difficult")
    map_elites = trials("map_elites", on="deceptive_maze_difficult")
    fails = hyperneat.never_reaches_the_target.stays()
    verdict({"full": fails & map_elites.has_found_the_target.in_most_trials(), "smoke": fails}[claim_tier])


@claim(
    "X1",
    says="None of the considered methods manages to address both complex locomotion and transfer learning",
    where="§6",
    smoke="In 10,000 steps no method leads the ant past the first stepping stone",
)
@pytest.mark.parametrize("method", ["neat", "hyperneat", "cma_es", "ppo"])
def test_no_method_leads_the_ant_through_the_maze(trials, verdict, method):
    ant = trials(method, on="stones_ant")
    verdict(ant.crosses_at_most(1).stays())
