"""Fig. 10: rewards in the easy deceptive maze."""

from evoclaims.figures import Figure, Histogram, HistogramPanel, Threshold
from reproductions.nisioti2025.figures import HYPERNEAT, PPO

FIGURE = Figure(
    name="fig10",
    title="Rewards in the easy deceptive maze",
    where="§5.2.3, Fig. 10",
    paint=Histogram(
        conditions=(
            HistogramPanel("HyperNEAT, SimpleRob", HYPERNEAT, "deceptive_maze_easy"),
            HistogramPanel("PPO, SimpleRob", PPO, "deceptive_maze_easy"),
            HistogramPanel("HyperNEAT, ant", HYPERNEAT, "deceptive_maze_easy_ant"),
        ),
        measure=lambda trials: trials.reward,
        xlabel="reward of an episode",
        mark=Threshold(1.0, "reward at which the target is reached"),
        remarks=(
            "Each dot is one trial: its final policy's mean over ten evaluation episodes. The paper shows the episodes "
            "of a single policy.",
        ),
    ),
)
