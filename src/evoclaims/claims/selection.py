"""Claims as a user names them: by id, by a claim test's whole name, or by the letters that ids begin with."""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import Final

from evoclaims.core.errors import UnknownNameError, UserError

_COMMA: Final = re.compile(r",(?![^\[]*\])")
"""A comma between names, and not in the parameters of one, such as "G6[cma_es,ppo]"."""


def selected(option: str, known: Collection[str], *, incomplete: bool = False) -> set[str]:
    """Return the known names that an option such as "G1,S" selects: G1 and all of S1, S2, ….

    Args:
        option: names, separated by commas.
        known: ids of claims, and perhaps whole names such as "G1[n_parity]".
        incomplete: there are files whose claims are not known, since pytest has failed to collect them.

    Raises:
        UserError: for a name that selects nothing, and when there is no name.
    """
    chosen: set[str] = set()
    for name in filter(None, map(str.strip, _COMMA.split(option))):
        begun = {one for one in known if name.isalpha() and re.match(rf"{name}\d", one)}
        found = {name} & set(known) or begun
        if not found:
            if incomplete:
                raise UserError(
                    f"There is no claim named {name!r} in the files that were collected. Other files were "
                    "not collected; the errors above give the reasons."
                )
            if not known:
                raise UserError(
                    f"There is no claim named {name!r} here, since pytest has collected no claims at all. "
                    "Run it in the project's root, or name the folder of the claims (pytest ../claims)."
                )
            alike = {one for one in known if ("[" in one) == ("[" in name)}
            raise UnknownNameError("claim", name, alike or known)
        chosen |= found
    if not chosen:
        raise UserError(f"{option!r} names no claim. Name some, such as G1 or G1,S2, or leave the option out.")
    return chosen
