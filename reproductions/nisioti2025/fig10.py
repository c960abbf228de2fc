"""Fig. 10: rewards in the easy deceptive maze."""

from evoclaims.figures import Figure, Histogram, Mark, Subject
from reproductions.nisioti2025.figures import HYPERNEAT, PPO

FIGURE = Figure(
    name="fig10",
    title="Rewards in the easy deceptive maze",
    where="§5.2.3, Fig. 10",
    paint=Histogram(
        conditions=(
            Subject("HyperNEAT, SimpleRob", HYPERNEAT, "deceptive_maze_easy"),
            Subject("PPO, SimpleRob", PPO, "deceptive_maze_easy"),
            Subject("HyperNEAT, ant", HYPERNEAT, "deceptive_maze_easy_ant"),
        ),
        measure=lambda trials: trials.reward,
        xlabel="reward of an episode",
        mark=Mark(1.0, "reward at which the target is reached"),
        remarks=(
            "Each dot is one trial: its final policy's mean over ten evaluation episodes. The paper shows the episodes "
            "of a single policy.",
        ),
    ),
)
