"""Maps of elites: the fitness of each elite where its episode ended, from champions stored or committed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evoclaims.core.errors import UserError
from evoclaims.envs.ecorobot.maze import Maze
from evoclaims.envs.ecorobot.views.pictures import paint_elites, paint_ground
from evoclaims.figures import sheet
from evoclaims.figures.figure import Drawing, Heading, Scope
from evoclaims.figures.sheet import FAINT, SMALL, TEXT, plain
from evoclaims.figures.trial_numbers import MeasureOf, TrialNumbers, absences, frame, read
from evoclaims.paper import references
from evoclaims.trials import champion_replay

LINE: Final = 0.12
"""Height of a line below a panel, inches."""
HOW: Final = (
    "Colour: fitness of the elite whose episode ended in the cell; white: no elite. Numbers: stones in their order. "
    "Red: the target."
)


@dataclass(frozen=True)
class Ground:
    """A maze that a map lies over.

    Attributes:
        title: of the panel.
        method, task: the condition.
    """

    title: str
    method: str
    task: str


class Map(NamedTuple):
    """The map of one trial: its seed, its id, and fitnesses [cells along x, along y], -inf where there is no elite."""

    seed: int
    trial: str
    fitnesses: NDArray[np.floating]


@dataclass(frozen=True)
class ElitesMap:
    """Maps side by side, each of the first trial whose champion is stored or committed; below, measures of all trials.

    Attributes:
        grounds: one per panel.
        listed: measures of all trials that are listed below each panel, by their labels.
        width: of the figure, inches.
    """

    grounds: tuple[Ground, ...]
    listed: tuple[tuple[str, MeasureOf], ...]
    width: float = 7.0

    def __call__(self, scope: Scope, heading: Heading) -> Drawing:
        """Draw the maps from a tier's trials."""
        read_all = [
            [(name, read(scope, one.method, one.task, measure)) for name, measure in self.listed]
            for one in self.grounds
        ]
        maps = [_first_map(scope, one) for one in self.grounds]
        absent = absences(numbers for listed in read_all for _, numbers in listed)
        without = [_unmapped(scope, one) for one, found in zip(self.grounds, maps, strict=True) if found is None]
        missing = (*absent, *without)
        with plain():
            row = sheet.PanelRow(0.0, below=0.44 + 2 * len(self.listed) * LINE, right=0.6, columns=len(self.grounds))
            wide = row.wide(self.width)
            figure, axes = sheet.build(heading, self.width, [replace(row, height=wide)], [], [*missing, HOW])
            for axis, one, found, listed in zip(axes, self.grounds, maps, read_all, strict=True):
                _paint(axis, _task(scope, one), one, found, listed, wide)
        panels = zip(self.grounds, maps, read_all, strict=True)
        table = frame((row for one, found, listed in panels for row in _rows(one, found, listed)), "x", "y")
        shown = sum(len(numbers.values) for listed in read_all for _, numbers in listed)
        return Drawing(figure, table, (HOW,), missing, shown, f"{heading.title} ({heading.place})")


def _task(scope: Scope, ground: Ground) -> Maze:
    task = scope.tier.condition(ground.method, ground.task).task
    if not isinstance(task, Maze):
        raise UserError(f"A map of elites needs the area of a maze; {ground.task!r} is not a maze.")
    return task


def _first_map(scope: Scope, ground: Ground) -> Map | None:
    """Return the map of the first trial whose champion is in the store, or committed; None without any."""
    condition, folder = scope.tier.condition(ground.method, ground.task), scope.archive.references
    for result in scope.group(ground.method, ground.task).fetch(scope.seeds):
        if scope.archive.store.has_champion(result):
            _, fitnesses = champion_replay.load(scope.archive.store, condition, result)
        elif folder is not None and (arrays := references.champion_of(folder, scope.tier_name, result)) is not None:
            _, fitnesses = champion_replay.unpacked(arrays, condition, result)
        else:
            continue
        return Map(result.seed, result.id, np.asarray(fitnesses))
    return None


def _unmapped(scope: Scope, ground: Ground) -> str:
    return (
        f"No map of {ground.method} on {ground.task} is stored (maps lie with champions, of which few are committed): "
        f"`evoclaims run {ground.method} --on {ground.task} --tier {scope.tier_name} --trials 1` makes one."
    )


def _paint(
    axis: Any, task: Maze, ground: Ground, found: Map | None, listed: list[tuple[str, TrialNumbers]], wide: float
) -> None:
    """Paint one map over its maze, and below it the measures of all trials, in lines of `wide` inches."""
    paint_ground(axis, task, ())
    axis.set_anchor("NW")
    title = ground.title if found is None else f"{ground.title} (seed {found.seed})"
    axis.set_title(title, loc="left", pad=5.0)
    if found is None:
        style = {"ha": "center", "va": "center", "fontsize": TEXT, "color": FAINT, "zorder": 9}
        box = {"facecolor": "white", "edgecolor": FAINT, "linewidth": 0.5, "boxstyle": "round,pad=0.4"}
        axis.text(0.5, 0.08, "no map of elites is stored", transform=axis.transAxes, bbox=box, **style)
    else:
        mesh = paint_elites(axis, task, found.fitnesses)
        bar = axis.figure.colorbar(mesh, cax=axis.inset_axes((1.03, 0.1, 0.03, 0.8)))
        bar.outline.set_linewidth(0.5)
    lines = [line for name, numbers in listed for line in sheet.wrap(f"{name}: {_summary(numbers)}", wide, SMALL)]
    corner = {"xycoords": "axes fraction", "xytext": (0, -30), "textcoords": "offset points"}
    axis.annotate("\n".join(lines), (0.0, 0.0), va="top", fontsize=SMALL, **corner)


def _summary(numbers: TrialNumbers) -> str:
    if not numbers.values:
        return "no values"
    spread = f" ± {_text(numbers.deviation)}" if len(numbers.values) > 1 else ""
    words = f"{_text(numbers.mean)}{spread} ({len(numbers.values)} of {len(numbers.each)} trials)"
    return words.replace(" ", "\u00a0")  # kept on one line


def _text(value: float) -> str:
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.2f}"


def _rows(ground: Ground, found: Map | None, listed: list[tuple[str, TrialNumbers]]) -> Iterator[dict[str, Any]]:
    """Yield a panel's rows of the table: the measures of all trials, then the elites of the map, by cell."""
    for name, numbers in listed:
        yield from numbers.rows(panel=ground.title, at=name, series=ground.method)
    if found is not None:
        names = {"panel": ground.title, "at": "map", "series": ground.method, "method": ground.method}
        common = {**names, "task": ground.task, "what": "elite", "seed": found.seed, "trial": found.trial}
        for x, y in zip(*np.nonzero(np.isfinite(found.fitnesses)), strict=True):
            yield {**common, "value": float(found.fitnesses[x, y]), "x": int(x), "y": int(y)}
