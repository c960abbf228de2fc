"""Sources that cannot have more trials than exist: a look that asks for more is not taken."""

from __future__ import annotations

from evoclaims.judging.assertion import Assertion
from evoclaims.judging.design import Design, Look
from evoclaims.judging.sample import Limited


def shortage(assertion: Assertion, look: Look, design: Design) -> str:
    """Say which source has too few trials for a look; empty if none has."""
    for source in assertion.sources():
        existing = source.existing if isinstance(source, Limited) else None
        if existing is not None and design.seeds(look.n)[-1] >= existing:
            few = f"there are {existing}" if existing > 1 else "there is 1" if existing else "there is none"
            return f"underpowered: needs n = {design.seeds(look.n)[-1] + 1} trials of {source.label}, and {few}"
    return ""
