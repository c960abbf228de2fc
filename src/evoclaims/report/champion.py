"""The champion of a condition's typical trial, and a drawing of its network or of what it does."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Final

from evoclaims.core.drawing import Format
from evoclaims.core.errors import UserError
from evoclaims.networks import export, picture
from evoclaims.report.model import ShownChampion
from evoclaims.report.trial_summary import TrialSummary
from evoclaims.trials import champions
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Condition
from evoclaims.trials.store import Store

LARGEST: Final = 400_000
"""Largest size of a drawing in a page, bytes."""


Draw = Callable[[Condition, TrialResult, Any, str], bytes | None]
"""Draws a champion as SVG: takes condition, record, parameters and a title; None where there is nothing to draw."""


def network(
    condition: Condition, result: TrialResult, parameters: Any, title: str, file_format: Format = "svg"
) -> bytes | None:
    """Draw the network of a champion that is a graph, beside it the one that it generates on a substrate.

    Raises:
        UserError: when matplotlib or networkx is not installed.
    """
    graph = champions.network_of(condition, parameters)
    if graph is None:
        return None
    nodes, drawing = export.to_networkx(parameters, graph), champions.substrate_of(condition, parameters)
    if drawing is None:
        panels = [picture.network_panel(nodes, graph, "the network that evolved")]
    else:
        panels = [
            picture.network_panel(nodes, graph, "the CPPN that evolved", ("x₁", "y₁", "x₂", "y₂"), ("q",)),
            picture.substrate_panel(*drawing, "the network that it draws"),
        ]
    return picture.draw(panels, title, file_format)


def champion_of(
    store: Store, condition: Condition, trials: Sequence[TrialSummary], draws: Sequence[Draw]
) -> ShownChampion:
    """Return the champion of the median trial, with the first of `draws`, in their order, that can be made."""
    chosen = typical(trials)
    if chosen is None:
        return ShownChampion("No trial has run to its end, so there is no champion to show.")
    trial, which = chosen
    if not trial.champion:
        return ShownChampion("No parameters of these trials are kept, so there is no champion to show.")
    try:
        result = next((one for one in store.records(trial.trial) if one.champion == trial.champion), None)
        if result is None or not store.champion_file(result).exists():
            return ShownChampion(
                f"The champion’s parameters ({which}) are not in the store: records alone are kept here."
            )
        parameters, title = champions.load(store, condition, result), f"{condition.label}, {which}"
        drawn = next((made for draw in draws if (made := draw(condition, result, parameters, title))), None)
    except UserError as error:
        return ShownChampion(f"The champion ({which}) cannot be drawn: {error}")
    if drawn is None:
        return ShownChampion(f"The champion ({which}) is no graph but arrays of weights, of which there is no drawing.")
    if len(drawn) > LARGEST:
        return ShownChampion(f"The champion’s drawing ({which}) is too large for this page: {len(drawn) // 1000} kB.")
    return ShownChampion(f"The champion: {which}.", drawn)


def typical(trials: Sequence[TrialSummary]) -> tuple[TrialSummary, str] | None:
    """Return the trial whose mean success is the median (the lower of two), and a text that says so.

    Only finished trials count; of equal ones, the lowest seed is taken.
    """
    scored = [(t.score, t.seed, t) for t in trials if t.status == "done" and t.score is not None]
    ranked = sorted((one for one in scored if math.isfinite(one[0])), key=lambda one: one[:2])
    if not ranked:
        return None
    middle = ranked[(len(ranked) - 1) // 2][0]
    trial = next(t for score, _, t in ranked if score == middle)
    return trial, f"seed {trial.seed}, the median of {len(ranked)} by mean success"
