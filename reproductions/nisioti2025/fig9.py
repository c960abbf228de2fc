"""Fig. 9: the maze with stepping stones, for the ant and the simplest robot."""

from evoclaims.figures import BarChart, Figure, compared
from reproductions.nisioti2025.figures import CMA_ES, HYPERNEAT, NEAT, PPO, PUBLISHED

METHODS = (NEAT, HYPERNEAT, CMA_ES, PPO)
PLACES = {"SimpleRob": "stones", "ant": "stones_ant"}

FIGURE = Figure(
    name="fig9",
    title="Effect of a more complex robot in the maze with stepping stones",
    where="§5.2.2, Fig. 9",
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
