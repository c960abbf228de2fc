"""Numbers that a paper has published: `reported.toml` of a reproduction, each with its place."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeGuard

from msgspec import ValidationError, convert

from evoclaims.core.errors import UserError, require_known
from evoclaims.core.files import read_file, read_text

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
        null: what an agent that does nothing gets; None where the file does not say.
    """

    value: float
    error: float | None
    place: str
    trials: int | None = None
    scale: tuple[float, float] | None = None
    precision: float = 0.0
    null: float | None = None


@dataclass(frozen=True)
class Published:
    """What a paper has published.

    Attributes:
        plots: by task and quantity (a measure of `TrialGroup`): "place", and for each of its "methods" a "mean", one
            number for each place on the axis, and an "error" if it has error bars; if known, "scale", "precision",
            "null".
        tables: by name: "place" and "values" of each table.
        trials: how many trials each number of a plot is the mean of; None where the file does not say.
    """

    plots: Mapping[str, Mapping[str, Mapping[str, Any]]]
    tables: Mapping[str, Mapping[str, Any]]
    trials: int | None = None

    def value(self, task: str, quantity: str, method: str, at: int = 0) -> Reported | None:
        """Return a method's number at a place on a plot's axis, counted from 0; None without one."""
        found = self.plots.get(task, {}).get(quantity, {})
        numbers = found.get("methods", {}).get(method)
        if numbers is None or at >= len(numbers["mean"]):
            return None
        error = float(numbers["error"][at]) if "error" in numbers else None
        low, high = found.get("scale", (None, None))
        scale = None if low is None else (float(low), float(high))
        precision = float(found.get("precision", 0.0))
        return Reported(
            float(numbers["mean"][at]), error, found["place"], self.trials, scale, precision, found.get("null")
        )

    def table(self, name: str) -> Mapping[str, Any]:
        """Return a table's "place" and "values"; an `UnknownNameError` lists the known tables."""
        require_known("published table", name, self.tables)
        return self.tables[name]


def load_published(path: Path) -> Published:
    """Read a file of published numbers.

    Raises:
        UserError: when it is missing or damaged, when a number does not name its place in the paper, or when something
            else stands where a number should.
    """
    try:
        plain = tomllib.loads(read_text(path))
    except (OSError, ValueError, RecursionError) as error:
        raise UserError(f"Cannot read the published numbers in {path}: {error}. Correct the file.") from error
    if wrong := [*_wrong_plots(plain.get("plots", {})), *_wrong_tables(plain.get("tables", {})), *_wrong_rest(plain)]:
        raise UserError(
            f"{path} has entries that are not as expected: {', '.join(wrong)}. Write [plots.TASK.QUANTITY] with a "
            "place and methods (each with a list mean, and an error of the same length, from 0 up, where known; "
            "scale = [lowest, highest], precision from 0 up, and null), [tables.NAME] with a place and values, and "
            "trials, the number of trials behind each mean, at least 2."
        )
    return Published(plain.get("plots", {}), plain.get("tables", {}), plain.get("trials"))


def _wrong_plots(plots: Any) -> Iterator[str]:
    for task, found in plots.items() if isinstance(plots, dict) else [("plots", plots)]:
        if isinstance(found, dict):
            yield from (f"{task}.{name}" for name, plot in found.items() if not _is_plot(plot))
        else:
            yield task


def _wrong_tables(tables: Any) -> Iterator[str]:
    for name, table in tables.items() if isinstance(tables, dict) else [("tables", tables)]:
        if not (isinstance(table, dict) and table.get("place") and table.get("values")):
            yield name


def _wrong_rest(plain: Mapping[str, Any]) -> Iterator[str]:
    """Yield the names of what is neither a plot nor a table, except a number of trials that have a spread."""
    yield from sorted(set(plain) - {"plots", "tables", "trials"})
    if not isinstance(trials := plain.get("trials", 2), int) or trials < 2:
        yield "trials"


def _is_plot(plot: Any) -> bool:
    """Whether a plot has its place, and each method has numbers on its scale and, if any errors, as many."""
    if not (isinstance(plot, dict) and plot.get("place") and plot.get("methods") and isinstance(plot["methods"], dict)):
        return False
    scale = plot.get("scale", [-math.inf, math.inf])
    if not (
        _are_numbers([precision := plot.get("precision", 0.0), plot.get("null", 0.0)])
        and 0 <= precision < math.inf
        and _are_numbers(scale)
        and len(scale) == 2
    ):
        return False
    low, high = scale
    return all(
        isinstance(numbers, dict)
        and _are_numbers(means := numbers.get("mean"))
        and _are_numbers(errors := numbers.get("error", [0.0] * len(means)))
        and len(errors) == len(means) > 0
        and all(0 <= error < math.inf for error in errors)  # else a number is outside an interval that is empty
        and all(low <= mean <= high and math.isfinite(mean) for mean in means)
        for numbers in plot["methods"].values()
    )


def _are_numbers(found: Any) -> TypeGuard[list[float]]:
    return isinstance(found, list) and all(isinstance(one, int | float) and not isinstance(one, bool) for one in found)


SENTENCES_FILE: Final = "sentences.toml"


@dataclass(frozen=True)
class Uncovered:
    """A sentence without a claim: its line in the paper's source, its words, and why no claim judges it."""

    line: int
    says: str
    because: str


@dataclass(frozen=True)
class _File:
    """The whole file."""

    sentence: tuple[Uncovered, ...]


def uncovered(folder: Path) -> tuple[Uncovered, ...]:
    """Return the sentences without a claim, in the paper's order; none without a file of them.

    Raises:
        UserError: when the file cannot be read.
    """
    path = folder / SENTENCES_FILE
    if not path.exists():
        return ()
    try:
        found = convert(tomllib.loads(read_file(path).decode()), _File).sentence
    except (OSError, ValueError, ValidationError) as error:
        raise UserError(
            f"Cannot read {path}: {error}. Write each [[sentence]] with line (a number), says and because."
        ) from error
    return tuple(sorted(found, key=lambda one: one.line))
