"""A drawing as files: PNG, SVG and CSV; the same trials give the same bytes."""

from __future__ import annotations

from evoclaims.core.drawing import Format, saved
from evoclaims.figures.figure import Drawing
from evoclaims.figures.style import plain

DOTS_PER_INCH = 220


def svg(drawing: Drawing) -> str:
    """Return the drawing as the text of an SVG file; words in it are text, and escaped."""
    return _picture(drawing, "svg").decode()


def contents(drawing: Drawing) -> dict[str, bytes]:
    """Return the contents of the drawing's files by their endings: pictures, on white, and every number drawn."""
    table: str = drawing.table.to_csv(index=False, lineterminator="\n")
    return {"png": _picture(drawing, "png"), "svg": _picture(drawing, "svg"), "csv": table.encode()}


def _picture(drawing: Drawing, file_format: Format) -> bytes:
    """Return the contents of a picture's file."""
    with plain():
        return saved(drawing.figure, file_format, drawing.title, dpi=DOTS_PER_INCH)
