"""Tables and other rich content as text: control characters in it are escaped, rich's colours are kept.

Rich itself drops five control characters and lets all others through, including the one that begins commands.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment

from evoclaims.core.printable import shown


class PlainSpokenConsole(Console):
    """A console that escapes control characters in all content, after its layout."""

    def __init__(self, **settings: Any) -> None:
        """Turn no word into an emoji."""
        super().__init__(emoji=False, **settings)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Yield the pieces that content is made of, each safe to print."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else segment._replace(text=shown(segment.text))
