"""The mutants of a reproduction: those that any paper may have, and its own."""

from __future__ import annotations

from collections.abc import Mapping

from evoclaims.core.errors import UserError
from evoclaims.mutants.mutant import MUTANTS, Mutant
from evoclaims.paper.importing import import_module
from evoclaims.paper.reproduction import Reproduction


def load(reproduction: Reproduction) -> Mapping[str, Mutant]:
    """Return all mutants by name, the reproduction's own last.

    Raises:
        UserError: when the module of its own does not import, holds no mutants, or one of another's name.
    """
    if not reproduction.mutants:
        return MUTANTS
    module = import_module(reproduction.mutants, reproduction.folder, f"the reproduction {reproduction.name!r}")
    own = getattr(module, "MUTANTS", None)
    if not isinstance(own, Mapping) or not all(isinstance(one, Mutant) for one in own.values()):
        raise UserError(f"The module {reproduction.mutants!r} has no MUTANTS = {{name: Mutant(...), ...}}.")
    taken = sorted(own.keys() & MUTANTS.keys())
    if taken:
        raise UserError(f"The module {reproduction.mutants!r} has a mutant called {taken[0]!r}, as every paper has.")
    return {**MUTANTS, **own}
