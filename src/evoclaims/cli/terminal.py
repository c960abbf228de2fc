"""Standard output as the progress line wants it."""

from __future__ import annotations

import shutil
import sys


class StdoutTerminal:
    """Standard output; rewritten in place only when a person is looking."""

    def __init__(self) -> None:
        """Look at what standard output is."""
        self.fullwidth = shutil.get_terminal_size().columns
        self.hasmarkup = sys.stdout.isatty()

    def write(self, msg: str, *, flush: bool = False) -> None:
        """Write text as it is."""
        print(msg, end="", flush=flush)
