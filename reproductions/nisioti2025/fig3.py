"""Fig. 3: success on the levels of both stepping-gates tasks."""

from evoclaims.figures import BarChart, Figure, by_level
from reproductions.nisioti2025.figures import CMA_ES, HYPERNEAT, NEAT, PPO, PUBLISHED

METHODS = (NEAT, HYPERNEAT, CMA_ES, PPO)

FIGURE = Figure(
    name="fig3",
    title="Success in the stepping-gates benchmark with levels of increasing difficulty",
    where="§5.1, Fig. 3",
    paint=BarChart(
        (
            by_level("n_parity", "N-parity", METHODS, PUBLISHED),
            by_level("simple_alu", "Simple ALU", METHODS, PUBLISHED),
        ),
        width=7.0,
    ),
)
