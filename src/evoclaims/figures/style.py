"""How figures look: one style, whatever the user's settings, with colours that all readers can tell apart."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Any, Final

from evoclaims.core.drawing import own_style

BLUE, SKY, GREEN, ORANGE, VERMILION, PURPLE, YELLOW = (
    "#0072b2",
    "#56b4e9",
    "#009e73",
    "#e69f00",
    "#d55e00",
    "#cc79a7",
    "#f0e442",
)
"""The palette of Okabe and Ito (2008), which readers with any colour vision can tell apart."""
INK, FAINT = "#222222", "#5f5f5f"
TITLE, TEXT, SMALL = 8.5, 7.0, 6.5
"""Sizes of letters, pt."""
COLUMN: Final = 3.5
"""Width of a column of a page, inches: the default width of a figure."""
_SETTINGS: Final[dict[str, Any]] = {
    "text.parse_math": False,  # dollar signs are plain text
    "font.size": TEXT,
    "text.color": INK,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": TEXT,
    "axes.labelsize": TEXT,
    "axes.formatter.limits": (-9, 9),
    "xtick.labelsize": TEXT,
    "ytick.labelsize": TEXT,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "legend.fontsize": TEXT,
    "hatch.linewidth": 0.6,
}


def plain() -> AbstractContextManager[None]:
    """Draw, or write, in this module's style.

    Raises:
        UserError: when matplotlib is not installed.
    """
    return own_style(**_SETTINGS)


def lighter(colour: str, share: float = 0.5) -> str:
    """Return a colour mixed with white; `share` is white's."""
    channels = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    return "#" + "".join(f"{round(c + (255 - c) * share):02x}" for c in channels)
