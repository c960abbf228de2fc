"""Fig. 5: the maze with stepping stones, the simplest robot."""

from evoclaims.figures import BarChart, Figure, compared
from reproductions.nisioti2025.figures import CMA_ES, GOAL_PPO, HYPERNEAT, MAP_ELITES, NEAT, PPO, PUBLISHED

METHODS = (NEAT, HYPERNEAT, CMA_ES, PPO, GOAL_PPO, MAP_ELITES)
PLACES = {"": "stones"}

FIGURE = Figure(
    name="fig5",
    title="Progress through the stepping stones in the maze (SimpleRob)",
    where="§5.2.1, Fig. 5",
    paint=BarChart(
        (
            compared(
                "stones",
                lambda trials: trials.stones,
                METHODS,
                PLACES,
                PUBLISHED,
                ylabel="stones crossed, of 7",
                limits=(0.0, 7.0),
            ),
            compared("reward", lambda trials: trials.reward, METHODS, PLACES, PUBLISHED, ylabel="reward of an episode"),
        )
    ),
)
