"""Files that commands write for the user, where --out says or where they belong."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

from evoclaims.core.errors import UserError
from evoclaims.core.files import write_once, write_where_named

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
        write_once(Path(path.parts[0], ".gitignore"), b"*\n", f"Name another {name} with --out.")
    write_where_named(path, data, f"Name another {name} with --out.")
