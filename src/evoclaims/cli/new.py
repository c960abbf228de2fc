"""`evoclaims new`: write a starter project that runs, or a copy of a paper's project."""

from __future__ import annotations

import argparse
import itertools
import os
import shlex
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from evoclaims.core.errors import UserError, require_known

PROJECTS: Final = Path(__file__).parents[1] / "projects"
"""What can be written: a folder for each paper, and the layers of starter projects."""

STARTERS: Final = PROJECTS / "starters"

KINDS: Final[Mapping[str, tuple[str, ...]]] = {
    "method": ("shared", "majority", "method"),
    "loop": ("shared", "majority", "loop"),
    "gymnasium": ("shared", "gymnasium"),
    "csv": ("shared", "csv"),
}
"""The layers of each kind of starter project: a file of a later one stands in the place of an earlier one's."""

CHECKOUT: Final = PROJECTS.parents[2]
"""Where a paper's claims and its reproduction are in evoclaims' own repository; a wheel has them in `PROJECTS`."""

PARTS: Final = ("docs", "reproductions", "claims", "pyproject.toml")
"""What a project consists of, with the pages that its claims name, if any; its settings come last, so that a part of
one is not."""

GITIGNORE: Final = "__pycache__/\n.venv/\n"
"""Nobody should commit these: Python rewrites them, and trials would then have run changed files."""

NEXT: Final = "next.txt"
"""What to do next, in one or more layers."""


def main(options: argparse.Namespace) -> int:
    """Write the project and say what to do next."""
    if options.paper is None:
        require_known("kind of starter project", options.kind, KINDS)
        layers = [STARTERS / layer for layer in KINDS[options.kind]]
    else:
        layers = _paper(options.paper)
    folder = Path(options.folder)
    _check(folder)
    count = _write(layers, folder)
    print(f"wrote {count} files to {shlex.quote(str(folder.resolve()))}; next:\n")
    if folder.resolve() != Path.cwd():
        print(f"cd {shlex.quote(str(folder))}")
    for layer in layers:
        if (layer / NEXT).exists():
            print((layer / NEXT).read_text(encoding="utf-8"), end="")
    return 0


def _paper(name: str) -> list[Path]:
    require_known("paper", name, [path.name for path in PROJECTS.iterdir() if path.is_dir() and path != STARTERS])
    project = PROJECTS / name
    return [project] if (project / "claims").exists() else [CHECKOUT, project]


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


def _write(layers: Sequence[Path], folder: Path) -> int:
    """Copy the files of a project's layers into a folder, and return how many there are.

    Raises:
        UserError: when it cannot be written.
    """
    files: dict[Path, Path] = {}
    try:
        for part, layer in itertools.product(PARTS, layers):
            source = layer / part
            found = (path for path in sorted([source, *source.rglob("*")]) if path.is_file())
            files |= {path.relative_to(layer): path for path in found if path.parent.name != "__pycache__"}
        for name, path in files.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, folder / name)
        (folder / ".gitignore").write_text(GITIGNORE, encoding="utf-8")
    except OSError as error:
        reason = error.strerror or error
        raise UserError(
            f"Cannot write a project to {folder}: {reason}. Delete what is there, or name another."
        ) from error
    return len(files) + 1
