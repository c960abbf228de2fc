"""`evoclaims new`: write a new project that runs, or a copy of a paper's project."""

from __future__ import annotations

import argparse
import os
import shlex
import shutil
from pathlib import Path
from typing import Final

from evoclaims.core.errors import UnknownNameError, UserError

PROJECTS: Final = Path(__file__).parents[1] / "projects"
"""What can be written: a folder for each, with what to do next in `next.txt`."""

CHECKOUT: Final = PROJECTS.parents[2]
"""Where a paper's claims and its reproduction are in evoclaims' own repository; a wheel has them in `PROJECTS`."""

PARTS: Final = ("docs", "reproductions", "claims", "pyproject.toml")
"""What a project consists of, with the pages that its claims name, if any; its settings come last, so that a part of
one is not."""


def main(options: argparse.Namespace) -> int:
    """Write the project and say what to do next."""
    known = [path.name for path in PROJECTS.iterdir() if path.is_dir()]
    if options.project not in known:
        raise UnknownNameError("project", options.project, known)
    folder = Path(options.folder)
    _check(folder)
    _write(PROJECTS / options.project, folder)
    count = sum(path.is_file() for part in PARTS for path in (folder / part, *(folder / part).rglob("*")))
    print(f"wrote {count} files to {shlex.quote(str(folder.resolve()))}; next:\n")
    if folder.resolve() != Path.cwd():
        print(f"cd {shlex.quote(str(folder))}")
    print((PROJECTS / options.project / "next.txt").read_text(encoding="utf-8"), end="")
    return 0


def _check(folder: Path) -> None:
    """Reject a folder with something in it, other than a new git repository: nothing is overwritten.

    Raises:
        UserError: when it is not empty, no folder, or cannot be read.
    """
    try:
        held = sorted({*os.listdir(folder)} - {".git"})
    except FileNotFoundError:
        return
    except OSError as error:
        raise UserError(f"Cannot write a project to {folder}: {error.strerror or error}. Name a new folder.") from error
    if held:
        raise UserError(f"{folder} is not empty: {held[0]} is in it. Nothing was written; name a new folder.")


def _write(project: Path, folder: Path) -> None:
    """Copy a project into a folder.

    Raises:
        UserError: when it cannot be written.
    """
    try:
        elsewhere = project if (project / "claims").exists() else CHECKOUT
        for part in PARTS:
            source = (project if (project / part).exists() else elsewhere) / part
            for path in sorted([source, *source.rglob("*")]):
                target = folder / part / path.relative_to(source)
                if path.is_file() and target.parent.name != "__pycache__":
                    target.parent.mkdir(parents=True, exist_ok=True)
                    shutil.copy(path, target)
    except OSError as error:
        reason = error.strerror or error
        raise UserError(
            f"Cannot write a project to {folder}: {reason}. Delete what is there, or name another."
        ) from error
