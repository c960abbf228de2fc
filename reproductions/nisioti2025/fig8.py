"""Fig. 8: obstacles of constant height, without the curriculum."""

from evoclaims.figures import BarChart, Figure, compared
from reproductions.nisioti2025.figures import NEAT, PPO, PUBLISHED

FIGURE = Figure(
    name="fig8",
    title="Ablation for locomotion with obstacles: all of one height, medium or high",
    where="§5.2.1, Fig. 8",
    paint=BarChart(
        (
            compared(
                "reward",
                lambda trials: trials.reward,
                (NEAT, PPO),
                {"increasing": "obstacles", "medium": "obstacles_medium", "high": "obstacles_high"},
                PUBLISHED,
                ylabel="reward of an episode",
                comparable=("full",),
            ),
        )
    ),
)
