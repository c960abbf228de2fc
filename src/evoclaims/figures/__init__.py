"""Figures and tables of a paper, redrawn from trials: one module per way of drawing, independent of any paper.

`figure.load(reproduction, "fig3").draw(archive, reproduction, "full")` returns a `Drawing`; `sheet` writes it.
"""

from evoclaims.core.lazy import exported

__all__, __getattr__, __dir__ = exported(__name__)
