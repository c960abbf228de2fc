"""The cells and sentences that show the power of claims: plain texts, not yet escaped."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from evoclaims.claims.power import ClaimPower
from evoclaims.judging.power import ENOUGH
from evoclaims.judging.verdict import Outcome
from evoclaims.report.formatting import number, plural
from evoclaims.report.table_cells import NONE

_OUTCOMES: Final = tuple(outcome for outcome in Outcome if outcome.judged)

HEADINGS: Final = ("claim", "expected", "power", "95%", *(one.symbol for one in _OUTCOMES), "flips", "needs")


def cells(one: ClaimPower) -> tuple[str, ...]:
    """Return a row, a cell per heading."""
    found = one.power
    if found is None:
        return (one.name, str(one.expected), "unknown", *(NONE,) * (len(HEADINGS) - 3))
    low, high = found.interval
    needs = NONE if one.expected is Outcome.INCONCLUSIVE else f"> {found.most}"
    return (
        one.name,
        str(one.expected),
        f"{found.power:.3f}" + " below" * (not found.suffices),
        f"{low:.3f}–{high:.3f}",
        *(f"{found.share(outcome):.3f}" for outcome in _OUTCOMES),
        f"{found.flips:.3f}",
        needs if found.needed is None else str(found.needed),
    )


def about(claims: Sequence[ClaimPower], n: int) -> list[str]:
    """Say how to read the table, and how many verdicts of a run end otherwise."""
    known = [one.power for one in claims if one.power]
    if not known:
        return []
    missed, flipped = sum(1 - found.power for found in known), sum(found.flips for found in known)
    below = sum(not found.suffices for found in known)
    outcomes = ", ".join(f"{outcome.symbol} {outcome}" for outcome in _OUTCOMES)
    return [
        f"Power: the share of {known[0].draws:,} draws of {plural(n, 'trial')} a condition, with replacement from its "
        f"pilot, in which the claim ends as expected ({outcomes}); flips: in which it ends the other way; needs: about "
        f"how many trials {ENOUGH:g} takes. The interval is what draws leave open, not the pilot's size.",
        f"Of {plural(len(known), 'verdict')} of a run, {number(missed)} end otherwise than expected on average, "
        f"{number(flipped)} of them the other way. {plural(below, 'claim')} below {ENOUGH:g}.",
    ]


def troubles(claims: Sequence[ClaimPower]) -> list[str]:
    """Return a line for each claim whose power is unknown."""
    return [f"{one.name}: {one.trouble}" for one in claims if one.trouble]
