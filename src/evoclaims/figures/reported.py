"""Numbers that a paper has published: `reported.toml` of a reproduction, each with its place."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evoclaims.core.errors import UnknownNameError, UserError


@dataclass(frozen=True)
class Reported:
    """A published number.

    Attributes:
        value: the number.
        error: its error bar, as published; None where the source gives none.
        place: where the paper has it.
    """

    value: float
    error: float | None
    place: str


@dataclass(frozen=True)
class Published:
    """What a paper has published.

    Attributes:
        plots: by task and quantity: "place", and for each of its "methods" a "mean", one number for each place on the
            axis, and an "error" if it has error bars.
        tables: by name: "place" and "values" of each table.
    """

    plots: Mapping[str, Mapping[str, Mapping[str, Any]]]
    tables: Mapping[str, Mapping[str, Any]]

    def value(self, task: str, quantity: str, method: str, at: int = 0) -> Reported | None:
        """Return a method's number at a place on a plot's axis, counted from 0; None where there is none."""
        found = self.plots.get(task, {}).get(quantity, {})
        numbers = found.get("methods", {}).get(method)
        if numbers is None or at >= len(numbers["mean"]):
            return None
        error = float(numbers["error"][at]) if "error" in numbers else None
        return Reported(float(numbers["mean"][at]), error, found["place"])

    def table(self, name: str) -> Mapping[str, Any]:
        """Return a table's "place" and "values"; an `UnknownNameError` lists the known tables."""
        if name not in self.tables:
            raise UnknownNameError("published table", name, self.tables)
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
        *sorted(set(plain) - {"plots", "tables"}),
    ]
    if wrong:
        raise UserError(
            f"{path} holds [plots.TASK.QUANTITY] with a place and methods (each with mean, and error of the same "
            f"length where known) and [tables.NAME] with a place and values; these are neither: {', '.join(wrong)}."
        )
    return Published(plots, tables)


def _is_plot(plot: Any) -> bool:
    """Whether a plot has its place, and each method has numbers and, if any errors, as many."""
    return bool(plot.get("place") and plot.get("methods")) and all(
        numbers.get("mean") and len(numbers.get("error", numbers["mean"])) == len(numbers["mean"])
        for numbers in plot["methods"].values()
    )
