"""Fig. 7: the half-cheetah over obstacles of rising height."""

from evoclaims.figures import BarChart, Figure, compared
from reproductions.nisioti2025.figures import CMA_ES, HYPERNEAT, NEAT, PPO, PUBLISHED

FIGURE = Figure(
    name="fig7",
    title="Locomotion over obstacles of increasing height (HalfCheetah)",
    where="§5.2.1, Fig. 7",
    paint=BarChart(
        (
            compared(
                "reward",
                lambda trials: trials.reward,
                (NEAT, HYPERNEAT, CMA_ES, PPO),
                {"": "obstacles"},
                PUBLISHED,
                ylabel="reward of an episode",
                comparable=("full",),
            ),
        )
    ),
)
