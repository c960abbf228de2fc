"""Fig. 5: the maze with stepping stones, the simplest robot."""

from evoclaims.figures import Figure
from reproductions.nisioti2025.figures import CMA_ES, GOAL_PPO, HYPERNEAT, MAP_ELITES, NEAT, PPO, stones_and_rewards

FIGURE = Figure(
    name="fig5",
    title="Progress through the stepping stones in the maze (SimpleRob)",
    where="§5.2.1, Fig. 5",
    paint=stones_and_rewards((NEAT, HYPERNEAT, CMA_ES, PPO, GOAL_PPO, MAP_ELITES), {"": "stones"}),
)
