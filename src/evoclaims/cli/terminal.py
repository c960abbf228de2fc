"""Standard output and errors as commands write them: the one place where their text becomes safe to print."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any, Final

from evoclaims.core.errors import UserError
from evoclaims.core.files import write_once, write_where_named
from evoclaims.core.printable import shown, spelled


class OutputError(Exception):
    """What is printed cannot be written, such as to a file on a full disk; the message is a sentence for the user."""


@contextmanager
def _written() -> Iterator[None]:
    """Raise an `OutputError` for an error in a `with` block; a reader that has gone is not an error."""
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OutputError(f"Cannot write what is printed: {error.strerror or error}.") from error


class Styled:
    """A stream for text that may hold colours: only characters that the terminal lacks are spelled out."""

    def __init__(self, stream: Any) -> None:
        """Write to `stream`."""
        self.stream = stream

    def write(self, text: str) -> int:
        """Write text as it is; an `OutputError` says why that fails."""
        with _written():
            self.stream.write(spelled(text, self.stream.encoding))
        return len(text)

    def flush(self) -> None:
        """Write what is still in memory; raises as `write` does."""
        with _written():
            self.stream.flush()

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
    """Escape control characters in all that is printed in a `with` block; a stream that is closed leads nowhere."""
    with ExitStack() as stack:
        for stream, redirect in ((sys.stdout, redirect_stdout), (sys.stderr, redirect_stderr)):
            nowhere = None if stream else stack.enter_context(open(os.devnull, "w", encoding="utf-8"))
            stack.enter_context(redirect(Plain(stream or nowhere)))
        yield


def styled() -> Any:
    """Return standard output for the program's own colours and cursor movements."""
    return Styled(sys.stdout.stream if isinstance(sys.stdout, Plain) else sys.stdout)


def terminal() -> tuple[Callable[[str], None], int | None]:
    """Return the function that writes the progress line, and the columns of an interactive terminal, or None."""
    columns = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    return lambda text: print(text, end="", flush=True, file=styled()), columns


REPORT: Final = Path("report")
"""Where commands write what is to be read, unless --out says else."""

FIGURES: Final = Path("figures")
"""Where they write pictures."""


def write(path: Path, data: bytes, name: str = "file", *, ours: bool = False) -> None:
    """Write a file that the user named with --out, or a file in a folder named so.

    Args:
        path: the file.
        data: its content.
        name: what --out names: a file or a folder.
        ours: whether nothing was named; `REPORT` or `FIGURES` is then made with a `.gitignore` that keeps git out.

    Raises:
        UserError: when it cannot be written there.
    """
    if os.path.isdir(path):  # unlike `Path.is_dir`, also of what may not be looked at
        raise UserError(f"{path} is a folder; name a file in it with --out.")
    if ours and not os.path.lexists(path.parts[0]):
        write_once(Path(path.parts[0], ".gitignore"), b"*\n", f"name another {name} with --out.")
    write_where_named(path, data, f"name another {name} with --out.")
