"""Maps of elites: drawn from a stored champion, or said to be missing."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from small_paper import collisions, made, told, words

from evoclaims.core.errors import UserError
from evoclaims.envs.ecorobot.stones import SteppingStones
from evoclaims.figures.elites import ElitesMap, Ground
from evoclaims.methods.map_elites import MapElites
from evoclaims.networks.mlp import Mlp
from evoclaims.paper import references
from evoclaims.trials.arrays import pack
from evoclaims.trials.result import TrialResult
from evoclaims.trials.result_making import named_leaves
from evoclaims.trials.spec import Budget, Condition

CELLS = (8, 7)
METHOD = MapElites(Mlp((2,)), batch=2, initial=2, cells=CELLS)
MAZE = Condition(METHOD, SteppingStones(episode_steps=3), "whole_budget", Budget(generations=1))


def _covered(trial: TrialResult) -> float:
    return trial.curves["coverage"][-1]


ELITES = ElitesMap(
    (Ground("stones", "map_elites", "maze"),),
    (("coverage", lambda trials: trials.measure("coverage", _covered)), ("reward", lambda trials: trials.reward)),
)


@pytest.fixture
def mapped(paper: Any) -> Any:
    """The paper with MAP-Elites in a maze: records of two trials."""
    tier = paper.reproduction.tier("full")
    tiers = {"full": replace(tier, conditions={**tier.conditions, ("map_elites", "maze"): MAZE})}
    paper.reproduction = replace(paper.reproduction, tiers=tiers)
    for seed in (0, 1):
        paper.store.put(replace(made(MAZE, seed, 50.0), curves={"coverage": (0.1, 0.25 + seed / 2)}), {})
    return paper


def _champion() -> dict[str, Any]:
    fitnesses = np.full(CELLS, -np.inf, np.float32)
    fitnesses[2, 3], fitnesses[7, 0] = 5.0, -1.0
    size = METHOD.network.size(MAZE.task.observation_size, MAZE.task.action_size)
    return named_leaves((np.zeros(size, np.float32), fitnesses))


def test_the_map_of_the_first_stored_champion_is_drawn(mapped: Any) -> None:
    mapped.store.put(replace(made(MAZE, 2, 60.0), curves={"coverage": (1.0,)}), _champion())
    drawing = mapped.draw(ELITES)
    (mesh,) = [c for c in drawing.figure.axes[0].collections if c.get_array() is not None and c.get_array().size == 56]
    shown = mesh.get_array()
    assert shown.shape == CELLS[::-1]
    assert (shown[3, 2], shown[0, 7], shown.mask.sum()) == (5.0, -1.0, 54)
    elites = drawing.table[drawing.table["what"] == "elite"]
    assert list(zip(elites["x"], elites["y"], elites["value"], elites["seed"], strict=True)) == [
        (2, 3, 5.0, 2),
        (7, 0, -1.0, 2),
    ]
    assert "stones (seed 2)" in words(drawing)
    assert drawing.missing == ("Run in part: map_elites on maze (3 of 10 trials).",)
    assert collisions(drawing) == []


def test_a_committed_champion_has_a_map_too(mapped: Any) -> None:
    packed = pack(_champion())
    made_elsewhere = replace(made(MAZE, 2, 60.0), curves={"coverage": (1.0,)})
    trial = replace(made_elsewhere, champion=hashlib.sha256(packed).hexdigest())
    folder = mapped.reproduction.references
    references.write(references.path_of(folder, "full", "map_elites", "maze"), [trial])
    path = references.champion_path(folder, "full", trial)
    path.parent.mkdir()
    path.write_bytes(packed)
    assert "stones (seed 2)" in words(mapped.draw(ELITES))


def test_without_a_stored_champion_the_figure_says_so_and_tells_the_records(mapped: Any) -> None:
    drawing = mapped.draw(ELITES)
    assert "no map of elites is stored" in words(drawing)
    assert "`evoclaims run map_elites --on maze --tier full --trials 1` makes one." in told(drawing)
    assert "0.50 ± 0.35 (2 of 10 trials)" in told(drawing)
    assert "500 ± 0.00 (2 of 10 trials)" in told(drawing)
    assert "elite" not in set(drawing.table["what"])
    assert drawing.shown == 4


def test_only_a_maze_has_a_map(paper: Any) -> None:
    with pytest.raises(UserError, match="needs the area of a maze; 'small' is not a maze"):
        paper.draw(ElitesMap((Ground("no maze", "one", "small"),), ()))
