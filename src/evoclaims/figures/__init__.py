"""Figures and tables of a paper, redrawn from trials: one module for each way of drawing, and no paper in it.

`catalogue.load(reproduction, "fig3").draw(archive, reproduction, "full")` returns a `Drawing`; `svg` makes text of it.
"""

from evoclaims.figures.figure import Drawing, Figure
from evoclaims.figures.files import svg

__all__ = ["Drawing", "Figure", "svg"]
