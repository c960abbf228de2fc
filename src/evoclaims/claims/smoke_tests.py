"""Smaller statements that a test of its own judges: of which claim, and in which place among the claim's tests."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import pytest

from evoclaims.claims.claim import Claim, ClaimTest, Smaller, gap_of
from evoclaims.core.errors import UserError


def tests_of(name: str, place: object, make: Callable[[str, object], Sequence[pytest.Item]]) -> Sequence[pytest.Item]:
    """Return pytest's tests of a function with @claim(...), at the smoke tier those of its smoke test in their places.

    A function with @claim.smoke(...) has none besides.

    Args:
        name: of the function.
        place: the module or the class that has it.
        make: makes the tests of one function.

    Raises:
        UserError: when the place has a smoke test without its claim, or with other cases, or a claim with no smoke
            test or two.
    """
    places = reversed(place.__mro__) if inspect.isclass(place) else (place,)  # what is inherited comes first
    functions = {one: function for each in places for one, function in vars(each).items()}
    smoke_tests = _smoke_tests(functions)
    if name in {smoke_test for smoke_test, _ in smoke_tests.values()}:
        return []
    own = make(name, functions[name])
    if name not in smoke_tests:
        return own
    smoke_test, claim = smoke_tests[name]
    smaller = make(smoke_test, functions[smoke_test])
    for item in (*own, *smaller):
        item.add_marker(pytest.mark.claim(claim), append=False)  # the closest mark counts
    return _in_place(own, smaller, smoke_test)


def _stated_by(function: object) -> object:
    """Return what a function is marked with by @claim(...) or @claim.smoke(...); None for anything else."""
    function = function.__func__ if isinstance(function, staticmethod | classmethod) else function
    marks = getattr(function, "pytestmark", ()) if inspect.isfunction(function) else ()
    return next((mark.args[0] for mark in marks if mark.name == "claim" and mark.args), None)


def _smoke_tests(functions: Mapping[str, object]) -> dict[str, tuple[str, Claim]]:
    """Return the smoke tests by the names of their claims' tests, each with its claim, which has both statements."""
    claims, last, found = dict[str, Claim](), dict[str, str](), dict[str, tuple[str, Claim]]()
    for name, function in functions.items():
        match _stated_by(function):
            case Claim() as claim:
                claims[name], last[claim.id] = claim, name
            case Smaller() as smaller:
                of = last.get(smaller.id)
                if of is None:
                    raise UserError(
                        f"{name} is a smoke test of {smaller.id}, and no test above it has the claim {smaller.id}. "
                        "Write it right below the test of its claim."
                    )
                if of in found or claims[of].smoke != "":
                    other = found[of][0] if of in found else f"smoke={claims[of].smoke!r}"
                    raise UserError(
                        f"{name} is a smoke test of {smaller.id}, which has {other} already. Leave one out."
                    )
                found[of] = name, replace(claims[of], smoke=smaller.says)
    for name, claim in claims.items():
        if claim.smoke == "" and name not in found:
            raise UserError(
                f"The claim {claim.id} of {name} has no smoke test. Write one below it, with @claim.smoke"
                f'("{claim.id}", says=...); or smoke=... in the claim, if the same assertion judges that; or '
                "smoke=None, because=..., if no small instance can show it."
            )
    return found


def _in_place(own: Sequence[pytest.Item], smaller: Sequence[pytest.Item], smoke_test: str) -> list[pytest.Item]:
    """Return a claim's tests, with those of its smoke test in place of the ones that it cannot judge itself."""
    tests = {item: ClaimTest.of(item) for item in (*own, *smaller)}
    due = {item: tests[item].name for item in own if tests[item].tier == "smoke" and not gap_of(item, "smoke")}
    judged: dict[str, list[pytest.Item]] = {}
    for item in smaller:
        judged.setdefault(tests[item].name, []).append(item)
    if lacking := sorted({*due.values()} - {*judged}):
        raise UserError(
            f"The smoke test {smoke_test} lacks {', '.join(lacking)}. Give it all parameters of its claim, or mark "
            "there with without_smoke(because=...) what no small instance can show."
        )
    if beyond := sorted({*judged} - {*due.values()}):
        raise UserError(
            f"The smoke test {smoke_test} judges {', '.join(beyond)}, which its claim does not have, or marks with "
            "without_smoke. Leave that out."
        )
    made: list[pytest.Item] = []
    for item in own:  # of tests that a plugin repeats the first has the place
        made += judged.pop(due[item], []) if item in due else [item]
    return made
