"""A paper's testable sentences that no claim judges, and why: `sentences.toml` beside a reproduction."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from msgspec import ValidationError, convert

from evoclaims.core.errors import UserError
from evoclaims.core.files import read_file

FILE: Final = "sentences.toml"


@dataclass(frozen=True)
class Uncovered:
    """A sentence without a claim: its line in the paper's source, its words, and why no claim judges it."""

    line: int
    says: str
    because: str


@dataclass(frozen=True)
class _File:
    """The whole file."""

    sentence: tuple[Uncovered, ...]


def uncovered(folder: Path) -> tuple[Uncovered, ...]:
    """Return the sentences without a claim, in the paper's order; none without a file of them.

    Raises:
        UserError: when the file cannot be read.
    """
    path = folder / FILE
    if not path.exists():
        return ()
    try:
        found = convert(tomllib.loads(read_file(path).decode()), _File).sentence
    except (OSError, ValueError, ValidationError) as error:
        raise UserError(
            f"Cannot read {path}: {error}. Each [[sentence]] has line (a number), says and because."
        ) from error
    return tuple(sorted(found, key=lambda one: one.line))
