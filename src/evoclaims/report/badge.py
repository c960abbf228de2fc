"""Badges: a label and a message as a small SVG picture, drawn without any font or script from elsewhere."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence
from html import escape
from typing import Final

from evoclaims.core.printable import printable
from evoclaims.judging.verdict import Outcome
from evoclaims.report import table_cells
from evoclaims.verdicts.claim_report import ClaimReport, Tally

GREEN, BLUE, RED, ORANGE, GREY = "#2e7d32", "#1565c0", "#c62828", "#a04000", "#616161"
_NARROW: Final = frozenset("fijlrtI.,:;|!'()[]{}/ ")
_WIDTHS: Final = {"narrow": 4.2, "usual": 7.0, "wide": 12.0}
"""Width of a character at font size 11, in units; `textLength` makes the text fit this estimate."""

_SVG: Final = """\
<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="20" role="img" aria-label="{label}: {message}">
<title>{label}: {message}</title>
<rect width="{width}" height="20" rx="3" fill="{colour}"/>
<path d="M3 0h{left_inner}v20H3a3 3 0 0 1-3-3V3a3 3 0 0 1 3-3z" fill="#424242"/>
<g fill="#fff" font-family="Verdana,DejaVu Sans,sans-serif" font-size="11">
<text x="6" y="14" textLength="{label_length}" lengthAdjust="spacingAndGlyphs">{label}</text>
<text x="{message_at}" y="14" textLength="{message_length}" lengthAdjust="spacingAndGlyphs">{message}</text>
</g>
</svg>
"""


def svg(label: str, message: str, colour: str) -> str:
    """Return a badge as SVG; texts are shown as they stand, on one line.

    Args:
        label: on the left, on grey.
        message: on the right.
        colour: behind the message, as CSS says it, such as "#2e7d32".
    """
    label, message = (printable(" ".join(text.split())) for text in (label, message))
    left, right = (round(sum(map(_width, text))) for text in (label, message))
    return _SVG.format(
        width=left + right + 24,
        left_inner=left + 9,
        message_at=left + 18,
        label_length=left,
        message_length=right,
        label=escape(label),
        message=escape(message),
        colour=escape(colour),
    )


def message_of(reports: Sequence[ClaimReport]) -> str:
    """Return the claims by outcome, controls apart: "supported 24 / refuted 5; controls: supported 9"."""
    return table_cells.totals(reports, "{outcome} {count}", " / ") if reports else "no claims"


def colour_of(reports: Sequence[ClaimReport]) -> str:
    """Return red where something failed, grey where nothing is judged, green where all is supported, else blue."""
    judged = [report for report in reports if report.outcome != Outcome.NOT_RUN]
    if any(report.failed for report in judged):
        return RED
    if not judged:
        return GREY
    return GREEN if all(report.counted_as is Tally.SUPPORTED for report in reports) else BLUE


def _width(character: str) -> float:
    """Return about how wide a character is."""
    if unicodedata.east_asian_width(character) in "WF":
        return _WIDTHS["wide"]
    return _WIDTHS["narrow" if character in _NARROW else "usual"]
