"""What the paper says, attached to the test that checks it; and the tests that pytest makes of that."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, TypeVar

import pytest

from evoclaims.core.errors import UserError, require_known
from evoclaims.core.printable import printable
from evoclaims.core.tiers import TIERS
from evoclaims.judging.verdict import Outcome
from evoclaims.verdicts.claim_report import named
from evoclaims.verdicts.readings import moment

F = TypeVar("F", bound=Callable[..., Any])

TIER: Final = "_claim_tier"
"""The parameter that makes a claim test run once per tier; the plugin makes it the last one."""

_REPETITION: Final = re.compile(r"(^|-)run\d+of\d+(?=-|$)")
"""The id of a parameter that only repeats a test, within the ids of all."""

third_look: Final = pytest.mark.claim_third_look
"""Mark of a claim, or of one `pytest.param(..., marks=...)` of it: thirty trials decide what ten leave open.

`third_look("submission")` is for the variant of this name instead of the protocol of the text. Its α is paid for
whichever claims have it, so that it may be chosen after ten trials (see `Design.with_third_look`).
"""


@dataclass(frozen=True)
class Claim:
    """One sentence of the paper.

    Attributes:
        id: a short name, such as "G1".
        says: the paper's own words.
        where: section and figure; "control" for a check of the benchmark itself and "mechanism" for
            a part of a method or task, which are counted apart.
        smoke: the scaled-down statement that the smoke tier judges instead; None if it judges none, and empty until
            tests are collected if a test of its own states it (see `claim.smoke`).
        line: of the paper's source in which the sentence stands; None where nobody says.
        read: the name of the reading that the test judges.
        since: when that reading was written (ISO 8601, UTC); empty where nobody says.
    """

    id: str
    says: str
    where: str
    smoke: str | None
    line: int | None = None
    read: str = "as judged"
    since: str = ""

    def is_read_at(self, tier: str) -> bool:
        """Whether a tier judges the paper's own sentence, whose readings count there."""
        return tier != "smoke" or self.smoke is None

    def statement(self, tier: str) -> str:
        """Return what is judged at a tier; the paper's own words where the smoke tier judges nothing."""
        return self.smoke if tier == "smoke" and self.smoke is not None else self.says


@dataclass(frozen=True)
class Expectation:
    """A verdict that was examined and accepted, so that it no longer fails a run.

    Attributes:
        outcome: the accepted outcome.
        because: what is known about why.
        tier: the tier it holds for; None for every tier.
    """

    outcome: Outcome
    because: str
    tier: str | None = None


@dataclass(frozen=True)
class Smaller:
    """The scaled-down statement of a claim, which a test of its own judges at the smoke tier."""

    id: str
    says: str


class _ClaimMark:
    """The marks `@claim(...)` and `@claim.smoke(...)` of the tests that check a claim."""

    def __call__(
        self,
        claim_id: str,
        /,
        *,
        says: str,
        where: str,
        smoke: str | None = "",
        expect: Outcome | None = None,
        because: str = "",
        line: int | None = None,
        read: str = "as judged",
        since: str = "",
    ) -> Callable[[F], F]:
        """Mark a test as the check of a claim; the test runs once per tier.

        Args:
            claim_id: a short name, such as "G1".
            says: the paper's own words.
            where: section and figure; "control" for a check of the benchmark itself and "mechanism" for
                a part of a method or task, which are counted apart.
            smoke: the scaled-down statement of the smoke tier, if the same test judges it; None if no small instance
                can show the sentence, which is then not judged there (see `without_smoke` for one parameter of a
                claim). Left out, a test of its own has it, right below (see `claim.smoke`).
            expect: an accepted outcome, for all that the test judges; a narrower one (see `expected`) overrides it.
            because: why it is accepted, or why there is no smoke test; required with `expect` and with `smoke=None`.
            line: the line of the paper's source in which the sentence stands.
            read: a name for the reading that the test judges; `verdict.reading(...)` adds others.
            since: when that reading was written, such as "2026-11-26" or "2026-11-26 14:30" (UTC).

        Raises:
            UserError: when a text is missing, `since` is not a date, `because` would have to explain two things, the
                test replaces that of another claim, or it is no function.
        """
        stated = {} if smoke in (None, "") else {"smoke": smoke}
        _check_texts("The claim", claim_id, says=says, where=where, **stated)
        if smoke is None and expect is not None:
            raise UserError(
                f"The claim {claim_id} has smoke=None and expect=...: its because=... says why there is no smoke test, "
                "so accept the outcome with @expected(...)."
            )
        if since:
            moment(since)
        marks = [pytest.mark.claim(Claim(claim_id, says, where, smoke, line, read, since))]
        if smoke is None:
            marks.append(without_smoke(because=because))
        if expect is not None:
            marks.append(expected(expect, because=because))

        return _attached(claim_id, marks)

    def smoke(self, claim_id: str, /, *, says: str) -> Callable[[F], F]:
        """Mark a test as the check of a claim's scaled-down statement; it runs at the smoke tier alone.

        It stands below the test of its claim, which has no `smoke=...`, and has the same parameters, except cases that
        the claim marks as `without_smoke`.

        Args:
            claim_id: that of the claim.
            says: the scaled-down statement.

        Raises:
            UserError: when a text is missing, or the test replaces that of another claim.
        """
        _check_texts("The smoke test of", claim_id, says=says)
        return _attached(claim_id, [pytest.mark.claim(Smaller(claim_id, says))])


claim: Final = _ClaimMark()


def _check_texts(what: str, claim_id: object, **texts: object) -> None:
    """Refuse what is no text, or empty."""
    for word, text in {"id": claim_id, **texts}.items():
        if not isinstance(text, str):
            raise UserError(f"{what} {claim_id!r} has {text!r} as its {word}, which is not text. Write it in quotes.")
        if not text.strip():
            raise UserError(f"{what} {claim_id or '(without id)'} lacks its {word}.")


TESTS: Final[list[tuple[str, Callable[..., Any]]]] = []
"""The id and the test of each claim that this process has read, also of those that nothing names any more."""


def _attached(claim_id: str, marks: list[pytest.MarkDecorator]) -> Callable[[F], F]:
    """Return the decorator that puts marks on a claim's test."""

    def attach(function: F) -> F:
        named = inspect.unwrap(getattr(function, "__func__", function))
        if not inspect.isclass(named) and (not inspect.isfunction(named) or named.__name__ == "<lambda>"):
            raise UserError(
                f"@claim({claim_id!r}, ...) is above {function!r}, which is no function that pytest can both mark "
                "and collect, so that it would never be judged. Write it above `def test_...(trials, verdict):`."
            )
        if (here := inspect.currentframe()) is not None and here.f_back is not None:
            _check_name(claim_id, function, here.f_back.f_locals)
        for mark in marks:
            function = mark(function)
        TESTS.append((claim_id, named))
        return function

    return attach


def _check_name(claim_id: str, function: Callable[..., Any], there: Mapping[str, object]) -> None:
    """Refuse a test whose name another claim's has in the same file or class: only the later one would be judged."""
    earlier = there.get(getattr(function, "__name__", ""))
    lines = [getattr(getattr(one, "__code__", None), "co_firstlineno", None) for one in (earlier, function)]
    replaced = [mark.args[0].id for mark in getattr(earlier, "pytestmark", ()) if mark.name == "claim"]
    if replaced and lines[0] != lines[1]:
        raise UserError(
            f"The tests of the claims {replaced[0]} and {claim_id} have one name, {function.__name__}, so that the "
            "second replaces the first, which would never be judged. Rename one of them."
        )


def expected(outcome: Outcome | str, *, because: str, tier: str | None = None) -> pytest.MarkDecorator:
    """Return a mark that accepts an outcome, for a whole claim or for one `pytest.param(..., marks=...)` of it.

    Args:
        outcome: the accepted one, such as `Outcome.REFUTED`.
        because: what is known about why.
        tier: the tier for which it is accepted; None for every tier.

    Raises:
        UserError: for an unknown outcome or tier, or without a reason.
    """
    if outcome not in set(Outcome):
        raise UserError(f"The outcome {outcome!r} does not exist. Use one of {', '.join(Outcome)}.")
    if not because.strip():
        raise UserError(f"An expected outcome ({outcome}) lacks its reason. Write because=...: what is known about it.")
    if tier is not None:
        require_known("tier", tier, TIERS)
    return pytest.mark.claim_expect(Expectation(Outcome(outcome), because, tier))


def without_smoke(*, because: str) -> pytest.MarkDecorator:
    """Return a mark for what the smoke tier does not judge: for one `pytest.param(..., marks=...)` of a claim.

    Raises:
        UserError: without a reason.
    """
    if not because.strip():
        raise UserError("A claim without a smoke test needs because=...: why no small instance can show it.")
    return pytest.mark.claim_without_smoke(because)


def gap_of(item: pytest.Item, tier: str) -> str:
    """Return why a test has no instance at a tier; empty if it has one."""
    mark = item.get_closest_marker("claim_without_smoke") if tier == "smoke" else None
    return str(mark.args[0]) if mark else ""


def claim_of(item: pytest.Item) -> Claim | Smaller | None:
    """Return the claim that a test checks, before tests are collected what it states in small; or None."""
    mark = item.get_closest_marker("claim")
    found: Claim | Smaller | None = mark.args[0] if mark and mark.args else None
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
    for node, mark in item.iter_markers_with_node("claim_expect"):
        expectation: Expectation = mark.args[0]
        # pytest lists the marks of a test before those of its parameters.
        distance = 0 if id(mark) in of_case else 1 + nodes.index(node)
        if expectation.tier in (None, tier):
            found.append((distance, expectation.tier is None, expectation))
    return min(found, key=lambda one: one[:2])[2] if found else None


def tier_id(claim: object, tier: str) -> str:
    """Return how a test's id ends, such as "G9-smoke": in characters that pytest never escapes."""
    named = claim.id if isinstance(claim, Claim | Smaller) else ""
    return "-".join(filter(None, (re.sub(r"[^A-Za-z0-9_.-]+", "_", named), tier)))


@dataclass(frozen=True)
class ClaimTest:
    """What a test judges.

    Attributes:
        claim: the paper's sentence.
        tier: "smoke" or "full".
        case: the ids of its parameters other than the tier, such as "n_parity"; empty without any.
        third_look: the variants under which thirty trials decide what ten leave open; "" is the protocol of the text.
    """

    claim: Claim
    tier: str
    case: str
    third_look: frozenset[str] = frozenset()

    @staticmethod
    def of(item: pytest.Item) -> ClaimTest:
        """Return what a test marked as a claim judges.

        Raises:
            UserError: when it has no tier, since it cannot take parameters, or when the mark holds no claim.
        """
        callspec, claim = getattr(item, "callspec", None), claim_of(item)
        stated = not isinstance(claim, Claim) or claim.smoke != ""  # else nothing has looked for its smoke test
        if callspec is None or TIER not in callspec.params or not stated:
            raise UserError(
                f"{item.nodeid} is a claim that cannot run at a tier. Write it as a function, or as a method of a "
                "class that is not a unittest.TestCase."
            )
        if not isinstance(claim, Claim):
            raise UserError(f"{item.nodeid} has the mark pytest.mark.claim but no claim: use @claim(...) of evoclaims.")
        tier: str = callspec.params[TIER]
        case: str = callspec.id.removesuffix(tier_id(claim, tier)).removesuffix("-")
        if item.get_closest_marker("claim_repeated"):
            case = _REPETITION.sub("", case).removeprefix("-")
        third = (name for mark in item.iter_markers("claim_third_look") for name in mark.args or ("",))
        return ClaimTest(claim, tier, case, frozenset(third))

    @property
    def name(self) -> str:
        """Id and parameters, such as "G1[n_parity]"."""
        return named(self.claim.id, self.case)

    @property
    def key(self) -> tuple[str, str]:
        """The key of its verdict, as `history.key_of` gives it."""
        return self.tier, printable(self.name)
