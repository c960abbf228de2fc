"""A drawing as files: PNG, SVG and CSV; the same trials give the same bytes."""

from __future__ import annotations

import io
from typing import Any

from evoclaims.figures.figure import Drawing
from evoclaims.figures.style import plain

DOTS_PER_INCH = 220


def svg(drawing: Drawing) -> str:
    """Return the drawing as the text of an SVG file; words in it are text, and escaped."""
    return _saved(drawing, "svg", {"Date": None, "Title": drawing.title}).decode()


def png(drawing: Drawing) -> bytes:
    """Return the drawing as a PNG file's contents, on white."""
    return _saved(drawing, "png", {"Software": None, "Title": drawing.title})


def csv(drawing: Drawing) -> str:
    """Return every number drawn as the text of a CSV file."""
    text: str = drawing.table.to_csv(index=False, lineterminator="\n")
    return text


def contents(drawing: Drawing) -> dict[str, bytes]:
    """Return the contents of the drawing's files by their endings."""
    return {"png": png(drawing), "svg": svg(drawing).encode(), "csv": csv(drawing).encode()}


def _saved(drawing: Drawing, file_format: str, metadata: dict[str, Any]) -> bytes:
    """Return the contents of a picture's file."""
    file = io.BytesIO()
    with plain():
        drawing.figure.savefig(file, format=file_format, metadata=metadata, dpi=DOTS_PER_INCH)
    return file.getvalue()
