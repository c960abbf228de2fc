"""§5.2.2 and §5.2.3: what the paper says about the ant, and about the deceptive mazes (Figs. 9 and 10).

Smoke judges the same relations in small rooms with one wall (docs/smoke.md). What a robot or a method does not do
there, another does in the same room.
"""

import pytest

from evoclaims import Outcome, claim, expected

WALKS = 0.01
"""Share of the room on the path of an ant that walks (smoke); one that takes no action comes by 0.2 to 0.4% of it."""

NO_ROOM_FAVOURS_HYPERNEAT = (
    "in small rooms with one wall HyperNEAT either stays there in nine trials of ten, as at full size, or PPO passes "
    "more often than it does (docs/smoke.md)"
)


@claim(
    "M1",
    says="The robot controlled by NEAT reaches only the first stepping stone in the maze",
    where="§5.2.2, Fig. 9",
    smoke="The ant controlled by NEAT walks, and reaches no more than one of three stones, the simplest robot two",
)
def test_the_ant_stays_at_the_first_stone(trials, verdict, claim_tier):
    ant, simple = trials("neat", on="stones_ant"), trials("neat", on="stones")
    contrast = ant.crosses_at_most(1.5).stays() & simple.stones.between(1.25, 3) & (ant.path_coverage > WALKS)
    verdict({"full": ant.crosses_at_most(1).stays(), "smoke": contrast}[claim_tier])


@claim(
    "M2",
    says="NEAT can no longer progress in the maze with stepping stones (contrast with Figure 5)",
    where="§5.2.2, Fig. 9",
    smoke="The ant controlled by NEAT reaches fewer of three stepping stones than the simplest robot",
)
def test_the_ant_is_far_below_the_simplest_robot(trials, verdict):
    ant = trials("neat", on="stones_ant")
    simple = trials("neat", on="stones")
    verdict(ant.stones < simple.stones)


@claim(
    "D1",
    says="in a simplified version of the deceptive maze ... HyperNEAT is able to avoid the local optimum and reach the "
    "target",
    where="§5.2.3, Fig. 10",
    smoke=None,
    because=NO_ROOM_FAVOURS_HYPERNEAT,
)
@expected(
    Outcome.REFUTED,
    tier="full",
    because="most trials stay in the local optimum, near the target; the others reach it in every episode",
)
def test_hyperneat_escapes_the_local_optimum(trials, verdict):
    hyperneat = trials("hyperneat", on="deceptive_maze_easy")
    verdict(hyperneat.reaches_the_target.in_most_trials())


@claim(
    "D2",
    says="PPO remains stuck at the nearby wall",
    where="§5.2.3, Fig. 10",
    smoke="PPO remains stuck at the wall across the straight way, while MAP-Elites finds the target behind it",
)
def test_ppo_stays_at_the_wall(trials, verdict, claim_tier):
    ppo = trials("ppo", on="deceptive_maze_easy")
    near = {"full": 2.0, "smoke": 1.0}[claim_tier]
    stuck = ppo.never_reaches_the_target.stays() & ppo.ends_within(near).in_most_trials()
    if claim_tier == "smoke":
        stuck &= trials("map_elites", on="deceptive_maze_easy").has_found_the_target.in_most_trials()
    verdict(stuck)


@claim(
    "D3",
    says="This ability of HyperNEAT disappears when we replace the simple morphology with the ant robot",
    where="§5.2.3, Fig. 10",
    smoke=None,
    because=f"the ability does not show with the simple morphology: {NO_ROOM_FAVOURS_HYPERNEAT}",
)
def test_the_ant_does_not_escape(trials, verdict):
    hyperneat = trials("hyperneat", on="deceptive_maze_easy_ant")
    verdict(hyperneat.never_reaches_the_target.stays())


@claim(
    "D4",
    says="It [the ability of HyperNEAT] also disappears when we consider the larger deceptive maze with multiple traps "
    "where methods that explicitly optimize for diversity excel",
    where="§5.2.1, §5.2.3, Figs. 6 and 10",
    smoke="MAP-Elites finds the target behind the wall, where HyperNEAT ends at the wall",
)
@expected(
    Outcome.REFUTED,
    tier="full",
    because="HyperNEAT fails, but MAP-Elites, too, has found the target in few trials (see S7)",
)
def test_hyperneat_fails_in_the_difficult_maze(trials, verdict, claim_tier):
    hyperneat = trials("hyperneat", on="deceptive_maze_difficult")
    map_elites = trials("map_elites", on="deceptive_maze_difficult")
    says = hyperneat.never_reaches_the_target.stays() & map_elites.has_found_the_target.in_most_trials()
    if claim_tier == "smoke":
        says &= hyperneat.ends_within(1.0).in_most_trials()
    verdict(says)


@claim(
    "X1",
    says="None of the considered methods manages to address both complex locomotion and transfer learning",
    where="§6",
    smoke="No method leads the ant past the first of three stones, though all but HyperNEAT's ants walk, and NEAT, "
    "HyperNEAT and CMA-ES lead the simplest robot further, and PPO collects more reward with it than a random policy",
)
@pytest.mark.parametrize("method", ["neat", "hyperneat", "cma_es", "ppo"])
def test_no_method_leads_the_ant_through_the_maze(trials, verdict, claim_tier, method):
    ant = trials(method, on="stones_ant")
    if claim_tier == "full":
        verdict(ant.crosses_at_most(1).stays())
        return
    simple = trials("neat" if method == "ppo" else method, on="stones")
    says = ant.crosses_at_most(1.5).stays() & (simple.stones > ant.stones)
    if method != "hyperneat":
        says &= ant.path_coverage > WALKS
    if method == "ppo":
        says &= trials("ppo", on="stones").reward > trials("random_policy", on="stones").reward
    verdict(says)
