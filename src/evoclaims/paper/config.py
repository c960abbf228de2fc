"""Where a project keeps its reproduction and its claims: `[tool.evoclaims]` in its pyproject.toml."""

from __future__ import annotations

import importlib
import pkgutil
import sys
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from evoclaims.core.errors import UserError, guess, in_one_line
from evoclaims.core.files import read_text
from evoclaims.trials.failed import DEFAULT_LIMIT, seconds_of

if TYPE_CHECKING:
    from evoclaims.paper.reproduction import Reproduction


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
    """Return which modules are beside one that is not there, and the one that it resembles or is a file of."""
    package = lacking.rpartition(".")[0]
    if package in sys.modules and not hasattr(sys.modules[package], "__path__"):
        return f" {package!r} is no package: write {package!r}."
    folders = list(getattr(sys.modules.get(package), "__path__", ())) if package else [str(root)]
    beside = [f"{package}.{one.name}".removeprefix(".") for one in pkgutil.iter_modules(folders)]
    return guess(lacking, beside) if beside else ""


@dataclass(frozen=True)
class SuiteConfig:
    """The project's settings.

    Attributes:
        root: the project's folder, put on the import path.
        reproduction: module that holds `REPRODUCTION`.
        claims: folder of claim tests, relative to `root`.
        time_limit: time that a batch of trials may take, such as "90s" or "24h" (see `seconds_of`).
        slurm: what this site's jobs ask for (`[tool.evoclaims.slurm]`), as `evoclaims submit` reads it.
    """

    root: Path
    reproduction: str
    claims: str = "claims"
    time_limit: str = DEFAULT_LIMIT
    slurm: Mapping[str, object] = field(default_factory=dict)

    def seconds(self, option: str | None) -> float:
        """Return the seconds that a batch of trials may take, from an option or else from these settings.

        Raises:
            UserError: when that is not a length of time.
        """
        if option is not None:
            return seconds_of(option)
        try:
            return seconds_of(self.time_limit)
        except UserError as error:
            raise UserError(f"{self.root / 'pyproject.toml'} has time_limit = {self.time_limit!r}. {error}") from error


def find_root(start: Path) -> Path:
    """Return the nearest folder at or above `start` whose pyproject.toml has `[tool.evoclaims]`.

    Raises:
        UserError: when it does not exist.
    """
    for folder in (start, *start.parents):
        if "evoclaims" in _tool_tables(folder / "pyproject.toml"):
            return folder
    raise UserError(
        f"No pyproject.toml at or above {start} has a [tool.evoclaims] table. Go to a project with claims, or add the "
        'table: reproduction = "package.module" (which holds REPRODUCTION) and claims = "folder".'
    )


def load_config(root: Path) -> SuiteConfig:
    """Read the settings of the project in `root`.

    Raises:
        UserError: when the table is missing, has other keys, or a value that is not text.
    """
    found = _tool_tables(root / "pyproject.toml").get("evoclaims")
    table = dict(found) if isinstance(found, dict) else {}
    slurm = table.pop("slurm", {})
    trouble = _trouble(table, slurm)
    if trouble or "reproduction" not in table:
        raise UserError(
            f'{trouble}{root / "pyproject.toml"} needs a [tool.evoclaims] table with reproduction = "package.module" '
            'and, if it is not "claims", claims = "folder"; time_limit = "24h" if trials may take another time; a '
            "table slurm for a site's jobs; no other keys."
        )
    return SuiteConfig(root=root, **table, slurm=slurm)


def _trouble(table: Mapping[str, object], slurm: object) -> str:
    """Say which key of the table is wrong; nothing if none is."""
    keys = ("reproduction", "claims", "time_limit")
    for key, value in table.items():
        if key not in keys:
            return f"[tool.evoclaims] has the unknown key {key!r}.{guess(key, (*keys, 'slurm'))} "
        if not isinstance(value, str):
            return f'[tool.evoclaims] has {key} = {value!r}, which is not text. Write it in quotes, as {key} = "…". '
    return "" if isinstance(slurm, dict) else f"[tool.evoclaims] has slurm = {slurm!r}, which is not a table. "


def make_importable(root: Path) -> None:
    """Let modules of the project in `root` be imported, by claim files and by each other."""
    if str(root) not in sys.path:
        sys.path.insert(0, str(root))


def load_reproduction(config: SuiteConfig) -> Reproduction:
    """Import the project's reproduction.

    Raises:
        UserError: when the module or its `REPRODUCTION` is missing, or the module does not import.
    """
    from evoclaims.paper.reproduction import Reproduction  # which needs jax, as no other setting does

    make_importable(config.root)
    module = import_module(config.reproduction, config.root, "[tool.evoclaims]")
    found = getattr(module, "REPRODUCTION", None)
    if not isinstance(found, Reproduction):
        raise UserError(
            f"The module {config.reproduction!r} has no REPRODUCTION = Reproduction(...). Add it, or name another "
            "module in [tool.evoclaims]."
        )
    return found


def _tool_tables(path: Path) -> dict[str, object]:
    """Return the tables under [tool] in a pyproject.toml; empty when there is no such file."""
    try:
        tool = tomllib.loads(read_text(path)).get("tool", {})
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, RecursionError) as error:
        raise UserError(f"Cannot read {path}: {error}. Correct the file.") from error
    return tool if isinstance(tool, dict) else {}
