"""Claim tests as pytest collects them: the tier and the case of each, and a name that no other has."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import pytest

from evoclaims.claims.claim import Claim, claim_of
from evoclaims.core.errors import UserError
from evoclaims.core.printable import printable
from evoclaims.verdicts.claim_report import named

TIER: Final = "claim_tier"
"""The parameter that makes a claim test run once per tier; the plugin makes it the first one."""


def tier_of(item: pytest.Item) -> str:
    """Return the tier that a claim test runs at.

    Raises:
        UserError: when it runs at none, being no test that takes parameters.
    """
    callspec = getattr(item, "callspec", None)
    if callspec is None or TIER not in callspec.params:
        raise UserError(
            f"{item.nodeid} is a claim and cannot be given a tier: write it as a function, or as a method of a class "
            "that is no unittest.TestCase."
        )
    tier: str = callspec.params[TIER]
    return tier


def case_of(item: pytest.Item) -> str:
    """Return the ids of a claim test's parameters other than the tier, such as "n_parity"; empty without any."""
    tier, ids = tier_of(item), item.callspec.id  # type: ignore[attr-defined]
    case: str = ids.removeprefix(tier).removeprefix("-")
    return case


def key_of(item: pytest.Item) -> tuple[str, str]:
    """Return what a claim test's verdict is kept under: `history.key_of` its report.

    Raises:
        UserError: as `tier_of` does, or when the mark holds no claim.
    """
    return tier_of(item), printable(named(_claim(item).id, case_of(item)))


def checked(items: Iterable[pytest.Item]) -> dict[pytest.Item, tuple[str, str]]:
    """Return the claim id and the tier of every claim test, once it is certain that they can be told apart.

    Raises:
        UserError: as `key_of` does, or when two tests have the same name and tier.
    """
    claims: dict[pytest.Item, tuple[str, str]] = {}
    first: dict[tuple[str, str], pytest.Item] = {}
    for item in items:
        tier, name = key_of(item)
        other = first.setdefault((tier, name), item)
        if other is not item:
            raise UserError(
                f"Two claim tests are called {name} at the {tier} tier, {other.nodeid} and {item.nodeid}, so that the "
                "verdict of one would take the other's place: give one of them another claim id or other parameter ids."
            )
        claims[item] = _claim(item).id, tier
    return claims


def _claim(item: pytest.Item) -> Claim:
    """Return a claim test's claim."""
    claim = claim_of(item)
    if not isinstance(claim, Claim):
        raise UserError(f"{item.nodeid} has the mark pytest.mark.claim but no claim: use @claim(...) of evoclaims.")
    return claim
