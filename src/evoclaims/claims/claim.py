"""What the paper says, attached to the test that checks it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import pytest

from evoclaims.core.errors import UserError
from evoclaims.judging.verdict import Outcome

F = TypeVar("F", bound=Callable[..., Any])

CLAIM_MARK = "claim"
EXPECT_MARK = "claim_expect"


@dataclass(frozen=True)
class Claim:
    """One sentence of the paper.

    Attributes:
        id: a short name, such as "G1".
        says: the paper's own words.
        where: section and figure.
        smoke: the scaled-down statement that the smoke tier judges instead.
    """

    id: str
    says: str
    where: str
    smoke: str

    def statement(self, tier: str) -> str:
        """Return what is judged at a tier."""
        return self.smoke if tier == "smoke" else self.says


@dataclass(frozen=True)
class Expectation:
    """A verdict that has been looked into and accepted, so that it no longer fails a run.

    Attributes:
        outcome: the accepted outcome.
        because: what is known about why.
        tier: the tier it holds for; None for every tier.
    """

    outcome: Outcome
    because: str
    tier: str | None = None


def claim(
    claim_id: str, /, *, says: str, where: str, smoke: str, expect: Outcome | None = None, because: str = ""
) -> Callable[[F], F]:
    """Mark a test as the check of a claim; the test runs once per tier.

    Args:
        claim_id: a short name, such as "G1".
        says: the paper's own words.
        where: section and figure.
        smoke: the scaled-down statement of the smoke tier.
        expect: an accepted outcome, for every tier and parameter; a narrower one (see `expected`) overrides it.
        because: why it is accepted; required with `expect`.

    Raises:
        UserError: when a text is missing.
    """
    for word, text in {"id": claim_id, "says": says, "where": where, "smoke": smoke}.items():
        if not text.strip():
            raise UserError(f"The claim {claim_id or '(without id)'} lacks its {word}.")
    marks = [pytest.mark.claim(Claim(claim_id, says, where, smoke))]
    if expect is not None:
        marks.append(expected(expect, because=because))

    def attach(function: F) -> F:
        for mark in marks:
            function = mark(function)
        return function

    return attach


def expected(outcome: Outcome | str, *, because: str, tier: str | None = None) -> pytest.MarkDecorator:
    """Return a mark that accepts an outcome, for a whole claim or for one `pytest.param(..., marks=...)` of it.

    Raises:
        UserError: for an unknown outcome, or without a reason.
    """
    if outcome not in set(Outcome):
        raise UserError(f"There is no outcome {outcome!r}; known: {', '.join(Outcome)}.")
    if not because.strip():
        raise UserError(f"An accepted {outcome} verdict says because=...: what is known about why.")
    return pytest.mark.claim_expect(Expectation(Outcome(outcome), because, tier))


def claim_of(item: pytest.Item) -> Claim | None:
    """Return the claim that a test checks, or None."""
    mark = item.get_closest_marker(CLAIM_MARK)
    found: Claim | None = mark.args[0] if mark and mark.args else None
    return found


def expectation_of(item: pytest.Item, tier: str) -> Expectation | None:
    """Return the accepted outcome that holds for a test at a tier: the one of the closest mark.

    A parameter's mark is closer than its test's, then come class and module; of equally close marks, one for this tier
    only is closer than one for every tier.
    """
    callspec = getattr(item, "callspec", None)
    of_case = {id(mark) for mark in callspec.marks} if callspec else set()
    nodes = item.listchain()[::-1]
    found: list[tuple[int, bool, Expectation]] = []
    for node, mark in item.iter_markers_with_node(EXPECT_MARK):
        expectation: Expectation = mark.args[0]
        # pytest lists the marks of a test before those of its parameters.
        distance = 0 if id(mark) in of_case else 1 + nodes.index(node)
        if expectation.tier in (None, tier):
            found.append((distance, expectation.tier is None, expectation))
    return min(found, key=lambda one: one[:2])[2] if found else None
