"""Import a project's own modules; any error in them becomes one sentence with the file and the line."""

from __future__ import annotations

import importlib
import pkgutil
import sys
from pathlib import Path
from types import ModuleType

from evoclaims.core.errors import UserError, guess
from evoclaims.core.raised import in_one_line


def import_module(name: str, root: Path, named_by: str) -> ModuleType:
    """Return a project's module.

    Args:
        name: of the module, with dots.
        root: the project's folder; errors name files relative to it.
        named_by: the setting that names it, such as "[tool.evoclaims]".

    Raises:
        UserError: when there is no such module, or when anything is raised while it is imported.
    """
    try:
        return importlib.import_module(name)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a module may raise SystemExit as well
        if isinstance(error, ModuleNotFoundError) and error.name and f"{name}.".startswith(f"{error.name}."):
            meant = _meant(error.name, root)
            raise UserError(f"There is no module {name!r} in {root}, which {named_by} names.{meant}") from error
        reason = in_one_line(error, root)
        raise UserError(f"The module {name!r}, which {named_by} names, does not import: {reason}.") from error


def _meant(lacking: str, root: Path) -> str:
    """Return which modules are beside one that is not there, and the one that it resembles; nothing without any."""
    package = lacking.rpartition(".")[0]
    folders = list(getattr(sys.modules.get(package), "__path__", ())) if package else [str(root)]
    beside = [f"{package}.{one.name}".removeprefix(".") for one in pkgutil.iter_modules(folders)]
    return guess(lacking, beside) if beside else ""
