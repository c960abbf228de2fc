"""Figures and tables of a paper, redrawn from trials: one module per way of drawing, independent of any paper.

`catalogue.load(reproduction, "fig3").draw(archive, reproduction, "full")` returns a `Drawing`; `files` writes it.
"""

from evoclaims.core.lazy import exported

__all__, __getattr__, __dir__ = exported(__name__)
