"""A paper of two methods, its trials made by hand, and what can be asked of a drawing."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from made_trials import trial_of
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from evoclaims.envs.gates.parity import NParity
from evoclaims.figures.bar_panel import Series
from evoclaims.figures.figure import Drawing, Heading, Painter, Scope
from evoclaims.figures.sheet import DOTS_PER_INCH, plain, svg
from evoclaims.judging.design import Design
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.paper.archive import Archive
from evoclaims.paper.reproduction import Reproduction, Tier
from evoclaims.trials.result import Status, TrialResult
from evoclaims.trials.spec import Budget, Condition
from evoclaims.trials.store import Store

ONE, OTHER = Series("one", "The One", "#0072b2"), Series("other", "The Other", "#d55e00")
CONDITIONS = {
    (method, task): Condition(HandBuilt(method == "other"), NParity(bits), "curriculum", Budget(generations=2))
    for method in ("one", "other")
    for task, bits in (("small", 3), ("large", 5))
}
HEADING = Heading("A title", "§1, Fig. 1 – full tier")


def made(condition: Condition, seed: int, value: float, status: Status = "done") -> TrialResult:
    """Return a record of a success on every level, the share nearest to `value`; its reward is ten times `value`."""
    metrics = {"last_fitness": 10 * value, "environment_steps": 1.0}
    return trial_of(condition, seed, min(max(value, 0.0), 1.0), status, metrics=metrics)


class Paper:
    """The paper at its only tier, with ten trials a condition, and a store to put them into."""

    def __init__(self, folder: Path) -> None:
        self.store = Store(folder / "store")
        tiers = {"full": Tier(CONDITIONS, Design.fixed(10))}
        self.reproduction = Reproduction("tiny", "A Tiny Paper", folder / "reproduction", tiers)

    def put(self, method: str, task: str, values: Mapping[int, Any] | list[Any]) -> None:
        """Store trials by seed, each a value or a pair of a value and a status."""
        for seed, value in values.items() if isinstance(values, Mapping) else enumerate(values):
            number, status = value if isinstance(value, tuple) else (value, "done")
            self.store.put(made(CONDITIONS[method, task], seed, number, status), {})

    @property
    def scope(self) -> Scope:
        """What figures are drawn from."""
        return Scope(Archive(self.store, self.reproduction.references), self.reproduction, "full")

    def draw(self, painter: Painter) -> Drawing:
        """Draw a figure."""
        return painter(self.scope, HEADING)


def words(drawing: Drawing) -> list[str]:
    """Return every line of text of the drawing's SVG, spaces as spaces."""
    root = ElementTree.fromstring(svg(drawing))
    found = ("".join(text.itertext()) for text in root.iter("{http://www.w3.org/2000/svg}text"))
    return [re.sub(r"\s+", " ", line).strip() for line in found]


def told(drawing: Drawing) -> str:
    """Return all text of the drawing as one."""
    return " ".join(words(drawing))


def _beyond(drawing: Drawing) -> set[Text]:
    """Return the labels of ticks that lie beyond their axis and are not painted."""
    axes = [axis for frame in drawing.figure.findobj(Axes) for axis in (frame.xaxis, frame.yaxis)]
    ticks = [(tick, sorted(axis.get_view_interval())) for axis in axes for tick in axis.get_major_ticks()]
    return {tick.label1 for tick, (low, high) in ticks if not low <= tick.get_loc() <= high}


def collisions(drawing: Drawing) -> list[str]:
    """Return the texts of a drawing that lie on each other, or beyond its edge; slanted ones only the latter."""
    with plain():
        drawing.figure.set_dpi(DOTS_PER_INCH)
        canvas = FigureCanvasAgg(drawing.figure)
        canvas.draw()
        beyond = _beyond(drawing)
        texts = drawing.figure.findobj(Text)
        drawn = [t for t in texts if t.get_visible() and t.get_text().strip() and t not in beyond]
        boxes = [(t, t.get_window_extent(canvas.get_renderer())) for t in drawn]
    width, height = canvas.get_width_height()
    page = [t.get_text() for t, box in boxes if box.x0 < 0 or box.y0 < 0 or box.x1 > width + 1 or box.y1 > height + 1]
    straight = [(t, box) for t, box in boxes if t.get_rotation() in (0.0, 90.0)]
    return page + [
        f"{a.get_text()} on {b.get_text()}"
        for i, (a, one) in enumerate(straight)
        for b, other in straight[i + 1 :]
        if min(one.x1, other.x1) - max(one.x0, other.x0) > 1.0 and min(one.y1, other.y1) - max(one.y0, other.y0) > 1.5
    ]
