"""Fig. 9: the maze with stepping stones, for the ant and the simplest robot."""

from evoclaims.figures import Figure
from reproductions.nisioti2025.figures import CMA_ES, HYPERNEAT, NEAT, PPO, stones_and_rewards

FIGURE = Figure(
    name="fig9",
    title="Effect of a more complex robot in the maze with stepping stones",
    where="§5.2.2, Fig. 9",
    paint=stones_and_rewards((NEAT, HYPERNEAT, CMA_ES, PPO), {"SimpleRob": "stones", "ant": "stones_ant"}),
)
