"""Errors meant for users, each one sentence on what was wrong and what to do; others in one line, with their place."""

from __future__ import annotations

import difflib
import math
import traceback
from collections.abc import Collection, Iterable
from numbers import Integral, Real
from pathlib import Path
from typing import Final

from evoclaims.core.printable import shown


class UserError(Exception):
    """An error that a user can cause and fix; shown as its message, without a traceback, and safe to print."""

    def __init__(self, message: object) -> None:
        """Store the message, made safe to print."""
        super().__init__(shown(message))


class StorageError(UserError):
    """A file that cannot be written, or a stored one that cannot be used: what ran is not to blame."""


class UnknownNameError(UserError):
    """An unknown name; the message lists the known names."""

    def __init__(self, kind: str, name: object, known: Iterable[str]) -> None:
        """Build the message from `kind` (such as "method"), the wrong `name` and the `known` ones."""
        super().__init__(f"There is no {kind} named {name!r}.{guess(name, known)}")


def require_known(kind: str, name: object, known: Collection[object]) -> None:
    """Raise an `UnknownNameError`, for a `kind` such as "method", unless the name is known."""
    if name not in known:
        raise UnknownNameError(kind, name, map(str, known))


def require_at_least(least: int, whose: str, **counts: object) -> None:
    """Raise a `UserError`, such as "PPO's minibatches must be at least 1, not 0.", but for whole numbers from there."""
    for name, count in counts.items():
        if not isinstance(count, Integral):
            raise UserError(f"{whose} {name} must be a whole number, not {count!r}.")
        if count < least:
            raise UserError(f"{whose} {name} must be at least {least}, not {count}.")


def require_finite(whose: str, **numbers: object) -> None:
    """Raise a `UserError`, such as "PPO's discounting must be a finite number, not nan.", for anything else.

    No comparison holds for NaN, so a bound alone, such as `if std <= 0`, lets it pass.
    """
    for name, number in numbers.items():
        if not isinstance(number, Real) or not math.isfinite(number):
            raise UserError(f"{whose} {name} must be a finite number, not {number!r}.")


def guess(name: object, known: Iterable[str]) -> str:
    """Return what follows on an unknown name: the known one that it resembles, if any, and all known ones."""
    names = sorted(known)
    near = difflib.get_close_matches(str(name), names, n=1)
    meant = f" Did you mean {near[0]!r}?" if near else ""
    return f"{meant} Known: {', '.join(names) or 'none'}."


_OWN: Final = Path(__file__).resolve().parents[1]
PACKAGE_FOLDERS: Final = frozenset({"site-packages", "dist-packages"})
"""Names of folders of installed packages."""

_READ_MORE: Final = "See https://"
"""How the last line of jax's longer messages begins: it leads to a page with what to write instead."""


def in_one_line(error: BaseException, root: Path) -> str:
    """Return an exception with its place, such as "ValueError: no such level (my_paper/tasks.py, line 7)".

    Args:
        error: the exception; a `UserError` is shown as its message, with a place only if it is in the project.
        root: the user's project; the place is the innermost frame in one of its files, else the innermost of all.
    """
    text = _text(error)
    sentence = text if isinstance(error, UserError) and text else f"{type(error).__name__}{': ' * bool(text)}{text}"
    place = _place(error, root)
    return sentence.removesuffix(".") + f" ({place})" * bool(place)


def is_of_project(error: BaseException, root: Path) -> bool:
    """Whether an exception has passed through the user's own files in the project `root`."""
    frames = (Path(frame.f_code.co_filename) for frame, _ in traceback.walk_tb(error.__traceback__))
    return any(is_in_project(file, root) for file in frames if not str(file).startswith("<"))


def _place(error: BaseException, root: Path) -> str:
    """Return where an exception was raised, such as "my_paper/tasks.py, line 7"; empty if not known."""
    if isinstance(error, SyntaxError):  # a module that does not compile has no frame
        if not error.filename:
            return ""
        if Path(error.filename).is_file():
            return _line(Path(error.filename), error.lineno, root)
    frames = [
        (Path(frame.f_code.co_filename), line)
        for frame, line in traceback.walk_tb(error.__traceback__)
        if not frame.f_code.co_filename.startswith("<")  # Python's import machinery, and code compiled from strings
    ]
    theirs = [(file, line) for file, line in frames if is_in_project(file, root)]
    shown = theirs if isinstance(error, UserError) else theirs or frames
    return _line(*shown[-1], root) if shown else ""


def _text(error: BaseException) -> str:
    """Return the first line of an exception's message, and where the last one says to read more."""
    try:
        words = error.msg if isinstance(error, SyntaxError) else str(error)
        first, *others = words.strip().splitlines() or [""]
        if others and others[-1].startswith(_READ_MORE):
            return f"{first.removesuffix('.')}; s{others[-1][1:]}"
        return first
    except Exception:  # an exception that cannot be printed must still be reported
        return ""


def is_in_project(file: Path, root: Path) -> bool:
    """Whether a file is the project's own: in its folder, but not in evoclaims or an installed package."""
    file = file.resolve()
    return (
        file.is_relative_to(root.resolve()) and not file.is_relative_to(_OWN) and PACKAGE_FOLDERS.isdisjoint(file.parts)
    )


def _line(file: Path, line: int | None, root: Path) -> str:
    """Return a file and line; the file relative to the project's folder if it is inside."""
    resolved, top = file.resolve(), root.resolve()
    name = resolved.relative_to(top) if resolved.is_relative_to(top) else file
    return f"{name}, line {line}" if line else str(name)
