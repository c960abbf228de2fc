"""A figure or table of a paper, and its drawing from a reproduction's trials."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.paper.archive import Archive
from evoclaims.paper.config import import_module
from evoclaims.paper.reproduction import Reproduction, Tier
from evoclaims.paper.trial_group import TrialGroup
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Condition

SIZES: Final = {
    "full": "full tier: the paper's size",
    "smoke": "smoke tier: smaller tasks and budgets than the paper's",
}
"""The tiers in words."""


@dataclass(frozen=True)
class Scope:
    """What a figure is drawn from.

    Attributes:
        archive: the trials.
        reproduction: whose conditions are drawn.
        tier_name: at which tier.
        variant: of the protocol; empty for the protocol itself.
    """

    archive: Archive
    reproduction: Reproduction
    tier_name: str
    variant: str = ""

    @property
    def tier(self) -> Tier:
        """The tier under the variant; an `UnknownNameError` lists the known ones."""
        return self.reproduction.tier(self.tier_name, self.variant)

    @property
    def seeds(self) -> tuple[int, ...]:
        """The seeds of the trials that the tier judges."""
        design = self.tier.design
        return design.seeds(design.last.n)

    def group(self, method: str, task: str) -> TrialGroup:
        """Return a condition's available trials, with the measures that claims use."""
        return self.reproduction.trials(method, task, self.tier.condition(method, task), self._present)

    def _present(self, condition: Condition, seeds: Sequence[int]) -> list[TrialResult]:
        return [trial for trial in self.archive.trials(condition, seeds) if trial is not None]


@dataclass(frozen=True, eq=False)
class Drawing:
    """A figure, drawn.

    Attributes:
        figure: a `matplotlib.figure.Figure`.
        table: a `pandas.DataFrame` with every number that is drawn, and the ids of the trials.
        caption: sentences that say how to read it; the figure has them too.
        missing: sentences that say what is missing or broke; the figure has them too.
        shown: how many of our numbers are drawn; 0 if there was nothing to draw.
        title: what the figure shows, and its place in the paper.
    """

    figure: Any
    table: Any
    caption: tuple[str, ...]
    missing: tuple[str, ...]
    shown: int
    title: str


@dataclass(frozen=True)
class Heading:
    """The text above a drawing.

    Attributes:
        title: what is shown.
        place: where in the paper, and at which tier.
    """

    title: str
    place: str


Painter = Callable[[Scope, Heading], Drawing]


@dataclass(frozen=True)
class Figure:
    """One figure or table of a paper.

    Attributes:
        name: a short name, such as "fig3"; files are named after it.
        title: what it shows.
        where: section and figure.
        paint: draws it.
    """

    name: str
    title: str
    where: str
    paint: Painter

    def draw(self, archive: Archive, reproduction: Reproduction, tier: str, variant: str = "") -> Drawing:
        """Draw the figure from a tier's trials; the figure itself says which trials are missing.

        Conditions that the variant does not change are drawn as they are under the protocol itself.

        Raises:
            UnknownNameError: for another tier or variant.
            UserError: when a record is damaged, or matplotlib is not installed.
        """
        scope = Scope(archive, reproduction, tier, variant)
        reproduction.tier(tier, variant)
        under = f", under {variant}" if variant else ""
        return self.paint(scope, Heading(self.title, f"{self.where} – {SIZES.get(tier, tier)}{under}"))


def names(reproduction: Reproduction) -> tuple[str, ...]:
    """Return the names of all figures, in the order of the paper."""
    return tuple(module.rpartition(".")[2] for module in reproduction.figures)


def load(reproduction: Reproduction, name: str) -> Figure:
    """Return a figure by its name, that of its module.

    Raises:
        UnknownNameError: for another name; it lists the known ones.
        UserError: when the module does not import, or holds no figure of this name.
    """
    if not reproduction.figures:
        raise UserError(f"The reproduction {reproduction.name!r} names no figures: Reproduction(figures=...) is empty.")
    modules = dict(zip(names(reproduction), reproduction.figures, strict=True))
    if name not in modules:
        raise UnknownNameError("figure", name, modules)
    module = import_module(modules[name], reproduction.folder, f"the reproduction {reproduction.name!r}")
    figure = getattr(module, "FIGURE", None)
    if not isinstance(figure, Figure) or figure.name != name:
        raise UserError(f"The module {modules[name]!r} has no FIGURE = Figure(name={name!r}, ...).")
    return figure
