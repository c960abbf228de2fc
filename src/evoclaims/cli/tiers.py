"""The tiers that a command is asked for."""

from __future__ import annotations

from typing import Final

from evoclaims.core.errors import UnknownNameError
from evoclaims.paper.reproduction import Reproduction

ALL: Final = "all"


def tiers_of(reproduction: Reproduction, name: str) -> tuple[str, ...]:
    """Return the tiers called `name`: one of them, or "all".

    Raises:
        UnknownNameError: when there is no such tier.
    """
    if name not in (*reproduction.tiers, ALL):
        raise UnknownNameError("tier", name, (*reproduction.tiers, ALL))
    return tuple(reproduction.tiers) if name == ALL else (name,)
