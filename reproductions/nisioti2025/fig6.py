"""Fig. 6: end positions of MAP-Elites' elites, in the deceptive maze and in the maze with stepping stones."""

from evoclaims.figures import ElitesMap, Figure, Ground

FIGURE = Figure(
    name="fig6",
    title="Maps of elites in the deceptive maze and in the maze with stepping stones",
    where="§5.2.1, Fig. 6",
    paint=ElitesMap(
        grounds=(
            Ground("without stones", "map_elites", "deceptive_maze_difficult"),
            Ground("with stepping stones", "map_elites", "stones"),
        ),
        listed=(
            ("share of the reachable cells with an elite", lambda trials: trials.archive_coverage),
            ("reward of the best elite in ten new episodes", lambda trials: trials.reward),
        ),
    ),
)
