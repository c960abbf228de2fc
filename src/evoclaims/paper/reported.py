"""Numbers that a paper has published: `reported.toml` of a reproduction, each with its place."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from evoclaims.core.errors import UserError, require_known

FILE: Final = "reported.toml"
"""Name of the file in a reproduction's folder."""


@dataclass(frozen=True)
class Reported:
    """A published number.

    Attributes:
        value: the number.
        error: its error bar, as published; None where the source gives none.
        place: where the paper has it.
        trials: how many trials it is the mean of; None where the file does not say.
        scale: the smallest and the largest value that a trial can have; None for no limits.
        precision: how far the number may be from the mean that was measured: 0.5 for a text's "five".
    """

    value: float
    error: float | None
    place: str
    trials: int | None = None
    scale: tuple[float, float] | None = None
    precision: float = 0.0


@dataclass(frozen=True)
class Published:
    """What a paper has published.

    Attributes:
        plots: by task and quantity (a measure of `TrialGroup`): "place", and for each of its "methods" a "mean", one
            number for each place on the axis, and an "error" if it has error bars; if known, "scale" and "precision".
        tables: by name: "place" and "values" of each table.
        trials: how many trials each number of a plot is the mean of; None where the file does not say.
    """

    plots: Mapping[str, Mapping[str, Mapping[str, Any]]]
    tables: Mapping[str, Mapping[str, Any]]
    trials: int | None = None

    def value(self, task: str, quantity: str, method: str, at: int = 0) -> Reported | None:
        """Return a method's number at a place on a plot's axis, counted from 0; None where there is none."""
        found = self.plots.get(task, {}).get(quantity, {})
        numbers = found.get("methods", {}).get(method)
        if numbers is None or at >= len(numbers["mean"]):
            return None
        error = float(numbers["error"][at]) if "error" in numbers else None
        low, high = found.get("scale", (None, None))
        scale = None if low is None else (float(low), float(high))
        precision = float(found.get("precision", 0.0))
        return Reported(float(numbers["mean"][at]), error, found["place"], self.trials, scale, precision)

    def table(self, name: str) -> Mapping[str, Any]:
        """Return a table's "place" and "values"; an `UnknownNameError` lists the known tables."""
        require_known("published table", name, self.tables)
        return self.tables[name]


def load_published(path: Path) -> Published:
    """Read a file of published numbers.

    Raises:
        UserError: when it is missing, damaged, or a number lacks its place.
    """
    try:
        plain = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise UserError(f"Cannot read the published numbers in {path}: {error}.") from error
    plots, tables = plain.get("plots", {}), plain.get("tables", {})
    wrong = [
        *(f"{task}.{name}" for task, found in plots.items() for name, plot in found.items() if not _is_plot(plot)),
        *(name for name, table in tables.items() if not table.get("place") or not table.get("values")),
        *sorted(set(plain) - {"plots", "tables", "trials"}),
    ]
    if not isinstance(trials := plain.get("trials", 2), int) or trials < 2:  # fewer have no spread
        wrong.append("trials")
    if wrong:
        raise UserError(
            f"{path} holds [plots.TASK.QUANTITY] with a place and methods (each with mean, and error of the same "
            "length where known; scale = [lowest, highest] and precision), [tables.NAME] with a place and values, and "
            f"trials = how many each mean is of, at least 2; these are neither: {', '.join(wrong)}."
        )
    return Published(plots, tables, plain.get("trials"))


def _is_plot(plot: Any) -> bool:
    """Whether a plot has its place, and each method has numbers on its scale and, if any errors, as many."""
    scale = plot.get("scale", [-math.inf, math.inf])
    if not (isinstance(scale, list) and len(scale) == 2):
        return False
    low, high = scale
    return bool(plot.get("place") and plot.get("methods")) and all(
        numbers.get("mean")
        and len(numbers.get("error", numbers["mean"])) == len(numbers["mean"])
        and all(low <= mean <= high for mean in numbers["mean"])
        for numbers in plot["methods"].values()
    )
