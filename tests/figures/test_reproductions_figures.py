"""Every figure of the reproduction, drawn at both tiers from the committed reference trials."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import pytest
from small_paper import collisions

from evoclaims.figures import figure
from evoclaims.figures.figure import Drawing
from evoclaims.paper.archive import Archive
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Condition
from evoclaims.trials.store import Store
from reproductions.nisioti2025 import REPRODUCTION

FIGURES = figure.names(REPRODUCTION)
Draw = Callable[[str, str], Drawing]


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Archive:
    """The committed trials, and an empty store."""
    return Archive(Store(tmp_path_factory.mktemp("figures") / "store"), REPRODUCTION.references)


@pytest.fixture(scope="module")
def draw(archive: Archive) -> Draw:
    """A function that draws a figure at a tier, each once."""
    return cache(lambda name, tier: figure.load(REPRODUCTION, name).draw(archive, REPRODUCTION, tier))


def _looked_at(archive: Archive, condition: Condition) -> Sequence[TrialResult | None]:
    """Return what verdicts look at: thirty trials where they are all there, else ten."""
    thirty = archive.trials(condition, range(30))
    return thirty[:10] if None in thirty else thirty


def _trials(drawing: Drawing) -> set[Any]:
    table = drawing.table
    return set(table[(table["what"] == "trial") & (table["status"] != "not run")]["trial"])


@pytest.mark.parametrize("tier", ["full", "smoke"])
@pytest.mark.parametrize("name", FIGURES)
def test_a_figure_draws_and_its_words_do_not_collide(draw: Draw, name: str, tier: str) -> None:
    drawing = draw(name, tier)
    assert collisions(drawing) == []
    assert len(drawing.table) > 0


@pytest.mark.parametrize("tier", ["full", "smoke"])
def test_the_gates_figures_show_every_committed_trial(archive: Archive, draw: Draw, tier: str) -> None:
    conditions = REPRODUCTION.tier(tier).conditions
    shown = {
        "fig3": [(m, t) for m in ("neat", "hyperneat", "cma_es", "ppo") for t in ("n_parity", "simple_alu")],
        "fig4": [(m, t) for m in ("neat", "ppo") for t in ("n_parity", "n_parity_direct")],
    }
    for name, names in shown.items():
        drawing = draw(name, tier)
        committed = [trial for pair in names for trial in _looked_at(archive, conditions[pair])]
        assert _trials(drawing) == {trial.id for trial in committed if trial is not None} != set()
        complete = tier == "full"  # smoke has trials of the conditions that its claims read
        assert (None not in committed, drawing.missing == ()) == (complete, complete)
