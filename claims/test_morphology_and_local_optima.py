"""§5.2.2 and §5.2.3: what the paper says about the ant, and about the deceptive mazes (Figs. 9 and 10).

Smoke judges the same relations in small rooms with one wall (docs/smoke.md). What a robot or a method does not do
there, another does in the same room.
"""

import pytest

from evoclaims import Outcome, claim, expected

FIRST, AUDIT = "2026-11-21 10:55", "2026-11-26"
"""When claims were first committed, before their trials; and when an audit added readings, after all of them."""
METHODS = ["neat", "hyperneat", "cma_es", "ppo"]
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
    line=415,
    read="the first stone and no more",
    since=AUDIT,
)
@expected(Outcome.REFUTED, because="NEAT's ants do not reach the first stone")
def test_the_ant_stays_at_the_first_stone(trials, verdict):
    ant = trials("neat", on="stones_ant")
    verdict.reading(
        "at most one stone",
        ant.crosses_at_most(1).stays(),
        because="that it gets no further; a robot that takes no action satisfies this",
        since=FIRST,
    )
    verdict(ant.stones.between(0.5, 1.5))


@claim.smoke(
    "M1", says="The ant controlled by NEAT walks, and reaches no more than one of three stones, the simplest robot two"
)
def test_the_ant_walks_no_further_than_one_stone(trials, verdict):
    ant, simple = trials("neat", on="stones_ant"), trials("neat", on="stones")
    verdict(ant.crosses_at_most(1.5).stays() & simple.stones.between(1.25, 3) & (ant.path_coverage > WALKS))


@claim(
    "M2",
    says="NEAT can no longer progress in the maze with stepping stones (contrast with Figure 5)",
    where="§5.2.2, Fig. 9",
    line=420,
    read="fewer stones than the simplest robot",
    since=FIRST,
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
    line=427,
    read="most trials do, in most episodes",
    since=FIRST,
    smoke=None,
    because=NO_ROOM_FAVOURS_HYPERNEAT,
)
@expected(
    Outcome.REFUTED,
    because="most trials stay in the local optimum, near the target; the others reach it in every episode",
)
def test_hyperneat_escapes_the_local_optimum(trials, verdict):
    hyperneat = trials("hyperneat", on="deceptive_maze_easy")
    verdict.reading(
        "in more than one trial of ten",
        hyperneat.reaches_the_target.in_most_trials(p0=0.1),
        because="Fig. 10 shows a single trained policy, and able does not mean always",
        since=AUDIT,
    )
    verdict.reading(
        "in more episodes than PPO",
        hyperneat.share_of_targets > trials("ppo", on="deceptive_maze_easy").share_of_targets,
        because="the sentence contrasts the two",
        since=AUDIT,
    )
    verdict(hyperneat.reaches_the_target.in_most_trials())


@claim(
    "D2",
    says="PPO remains stuck at the nearby wall",
    where="§5.2.3, Fig. 10",
    line=427,
    read="no episode of most trials, within 2 m",
    since=FIRST,
)
def test_ppo_stays_at_the_wall(trials, verdict):
    ppo = trials("ppo", on="deceptive_maze_easy")
    verdict.reading(
        "no episode of most trials",
        ppo.never_reaches_the_target.stays() & (ppo.reward > 0),
        because="where the wall is near is a number of ours",
        since=AUDIT,
    )
    verdict(ppo.never_reaches_the_target.stays() & ppo.ends_within(2.0).in_most_trials())


@claim.smoke(
    "D2", says="PPO remains stuck at the wall across the straight way, while MAP-Elites finds the target behind it"
)
def test_ppo_stays_at_the_wall_that_map_elites_passes(trials, verdict):
    ppo, map_elites = trials("ppo", on="deceptive_maze_easy"), trials("map_elites", on="deceptive_maze_easy")
    stuck = ppo.never_reaches_the_target.stays() & ppo.ends_within(1.0).in_most_trials()
    verdict(stuck & map_elites.has_found_the_target.in_most_trials())


@claim(
    "D3",
    says="This ability of HyperNEAT disappears when we replace the simple morphology with the ant robot",
    where="§5.2.3, Fig. 10",
    line=428,
    read="reaches it in few episodes, the simplest robot in more",
    since=AUDIT,
    smoke=None,
    because=f"the ability does not show with the simple morphology: {NO_ROOM_FAVOURS_HYPERNEAT}",
)
def test_the_ant_does_not_escape(trials, verdict):
    hyperneat = trials("hyperneat", on="deceptive_maze_easy_ant")
    simple = trials("hyperneat", on="deceptive_maze_easy")
    verdict.reading(
        "reaches it in no episode",
        hyperneat.never_reaches_the_target.stays(),
        because="an ability that is gone; a robot that takes no action satisfies this",
        since=FIRST,
    )
    verdict.reading(
        "does not reach it in most episodes",
        hyperneat.seldom_reaches_the_target.stays(),
        because="the complement of D1's event; a robot that takes no action satisfies this",
        since=AUDIT,
    )
    verdict(hyperneat.seldom_reaches_the_target.stays() & (simple.share_of_targets > hyperneat.share_of_targets))


@claim(
    "D4",
    says="It [the ability of HyperNEAT] also disappears when we consider the larger deceptive maze with multiple traps "
    "where methods that explicitly optimize for diversity excel",
    where="§5.2.1, §5.2.3, Figs. 6 and 10",
    line=429,
    read="HyperNEAT never, MAP-Elites in most trials",
    since=FIRST,
)
@expected(Outcome.REFUTED, because="HyperNEAT fails, but MAP-Elites finds the target in few trials, too (see S7)")
def test_hyperneat_fails_in_the_difficult_maze(trials, verdict):
    hyperneat = trials("hyperneat", on="deceptive_maze_difficult")
    map_elites = trials("map_elites", on="deceptive_maze_difficult")
    verdict.reading(
        "HyperNEAT never reaches it",
        hyperneat.never_reaches_the_target.stays(),
        because="what others find there is cited, not claimed; a robot that takes no action satisfies this",
        since=AUDIT,
    )
    verdict.reading(
        "MAP-Elites finds it more often",
        map_elites.target_found > hyperneat.share_of_targets,
        because="the sentence contrasts the two",
        since=AUDIT,
    )
    verdict(hyperneat.never_reaches_the_target.stays() & map_elites.has_found_the_target.in_most_trials())


@claim.smoke("D4", says="MAP-Elites finds the target behind the wall, where HyperNEAT ends at the wall")
def test_hyperneat_ends_at_the_wall(trials, verdict):
    hyperneat = trials("hyperneat", on="deceptive_maze_difficult")
    map_elites = trials("map_elites", on="deceptive_maze_difficult")
    contrast = hyperneat.never_reaches_the_target.stays() & map_elites.has_found_the_target.in_most_trials()
    verdict(contrast & hyperneat.ends_within(1.0).in_most_trials())


@claim(
    "X1",
    says="None of the considered methods manages to address both complex locomotion and transfer learning",
    where="§6",
    line=446,
    read="the ant crosses one stone at most, the simplest robot more",
    since=AUDIT,
)
@pytest.mark.parametrize("method", METHODS)
def test_no_method_leads_the_ant_through_the_maze(trials, verdict, method):
    ant, simple, half_cheetah = (trials(method, on=task) for task in ("stones_ant", "stones", "obstacles"))
    verdict.reading(
        "the ant crosses one stone at most",
        ant.crosses_at_most(1).stays(),
        because="without what the method does elsewhere; a robot that takes no action satisfies this",
        since=FIRST,
    )
    verdict.reading(
        "the half-cheetah does not pass all obstacles",
        half_cheetah.passes_at_most(14).stays() & (half_cheetah.obstacles_passed > 1),
        because="complex locomotion and transfer as well",
        since=AUDIT,
    )
    verdict(ant.crosses_at_most(1).stays() & (simple.stones > ant.stones))


@claim.smoke(
    "X1",
    says="No method leads the ant past the first of three stones, though all but HyperNEAT's ants walk, and NEAT, "
    "HyperNEAT and CMA-ES lead the simplest robot further, and PPO collects more reward with it than a random policy",
)
@pytest.mark.parametrize("method", METHODS)
def test_no_method_leads_the_ant_past_the_first_stone(trials, verdict, method):
    ant = trials(method, on="stones_ant")
    simple = trials("neat" if method == "ppo" else method, on="stones")
    says = ant.crosses_at_most(1.5).stays() & (simple.stones > ant.stones)
    if method != "hyperneat":
        says &= ant.path_coverage > WALKS
    if method == "ppo":
        says &= trials("ppo", on="stones").reward > trials("random_policy", on="stones").reward
    verdict(says)


@claim(
    "D5",
    says="PPO gets stuck on the deceptive wall, a policy that incurs close to optimal reward",
    where="§5.2.3, Fig. 10",
    line=435,
    read="a reward of 0.8 to 1, and never the target",
    since=AUDIT,
    smoke=None,
    because="the reward at the wall is a matter of the maze at its own size",
)
def test_the_wall_pays_well(trials, verdict):
    ppo = trials("ppo", on="deceptive_maze_easy")
    verdict.reading(
        "a reward of 0.9 to 1",
        ppo.reward.between(0.9 * ppo.whole_way, ppo.whole_way) & ppo.never_reaches_the_target.stays(),
        because="close to optimal may mean within a tenth",
        since=AUDIT,
    )
    verdict(ppo.reward.between(0.8 * ppo.whole_way, ppo.whole_way) & ppo.never_reaches_the_target.stays())
