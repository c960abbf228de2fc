"""Standard output and errors as commands write them: the one place where their text becomes safe to print."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from typing import Any

from evoclaims.core.printable import shown, spelled


class Styled:
    """A stream for text that may hold colours: only characters that the terminal lacks are spelled out."""

    def __init__(self, stream: Any) -> None:
        """Write to `stream`."""
        self.stream = stream

    def write(self, text: str) -> int:
        """Write text as it is."""
        self.stream.write(spelled(text, self.stream.encoding))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        """Return what else the stream can do."""
        return getattr(self.stream, name)


class Plain(Styled):
    """A stream for text from anywhere: control characters are escaped."""

    def write(self, text: str) -> int:
        """Write text with control characters escaped."""
        return super().write(shown(text))


@contextmanager
def plain_output() -> Iterator[None]:
    """Escape control characters in all that is printed in a `with` block."""
    with redirect_stdout(Plain(sys.stdout)), redirect_stderr(Plain(sys.stderr)):
        yield


def styled() -> Any:
    """Return standard output for the program's own colours and cursor movements."""
    return Styled(sys.stdout.stream if isinstance(sys.stdout, Plain) else sys.stdout)


def terminal() -> tuple[Callable[[str], None], int | None]:
    """Return the function that writes the progress line, and the columns of an interactive terminal, or None."""
    columns = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    return lambda text: print(text, end="", flush=True, file=styled()), columns
