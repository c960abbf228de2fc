"""A drawing as files: PNG, SVG and CSV; the same trials give the same bytes."""

from __future__ import annotations

from evoclaims.core.drawing import Format, saved
from evoclaims.figures.figure import Drawing
from evoclaims.figures.style import plain

DOTS_PER_INCH = 220


def svg(drawing: Drawing) -> str:
    """Return the drawing as the text of an SVG file; words in it are text, and escaped."""
    return _picture(drawing, "svg").decode()


def png(drawing: Drawing) -> bytes:
    """Return the drawing as a PNG file's contents, on white."""
    return _picture(drawing, "png")


def csv(drawing: Drawing) -> str:
    """Return every number drawn as the text of a CSV file."""
    text: str = drawing.table.to_csv(index=False, lineterminator="\n")
    return text


def contents(drawing: Drawing) -> dict[str, bytes]:
    """Return the contents of the drawing's files by their endings."""
    return {"png": png(drawing), "svg": svg(drawing).encode(), "csv": csv(drawing).encode()}


def _picture(drawing: Drawing, file_format: Format) -> bytes:
    """Return the contents of a picture's file."""
    with plain():
        return saved(drawing.figure, file_format, drawing.title, dpi=DOTS_PER_INCH)
