"""Fig. 4: the last level of N-parity, with the curriculum and without."""

from evoclaims.figures import BarChart, Figure, compared
from reproductions.nisioti2025.figures import NEAT, PPO, PUBLISHED

FIGURE = Figure(
    name="fig4",
    title="Ablation for the N-parity task: its last level, through the curriculum and directly",
    where="§5.1, Fig. 4",
    paint=BarChart(
        (
            compared(
                "last_success",
                lambda trials: trials.last_success,
                (NEAT, PPO),
                {"through the levels": "n_parity", "directly": "n_parity_direct"},
                PUBLISHED,
                ylabel="success on the last level",
                limits=(0.0, 1.0),
            ),
        )
    ),
)
