"""A reproduction's figures, by name; a figure's module is imported when it is asked for."""

from __future__ import annotations

from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.figures.figure import Figure
from evoclaims.paper.importing import import_module
from evoclaims.paper.reproduction import Reproduction


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
