"""The names of collected claim tests: repeated tests, names that are not unique, and names that options select."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Collection, Iterable, Sequence
from functools import cache
from types import ModuleType
from typing import Any, Final

import pytest

from evoclaims.claims.claim import TESTS, ClaimTest
from evoclaims.core.errors import UnknownNameError, UserError


def note_repetitions(metafunc: pytest.Metafunc) -> list[str]:
    """Return a list that fills with the parameters of a claim's test by which plugins only repeat it.

    Neither the test nor a fixture of it asks for such a parameter, so that it makes no other case of the claim. Its
    ids become those of `ClaimTest.case`.
    """
    asked, repeats, parametrize = frozenset(metafunc.fixturenames), list[str](), metafunc.parametrize

    def noting(argnames: str | Sequence[str], argvalues: Iterable[Any], *rest: Any, **options: Any) -> None:
        names = [name.strip() for name in argnames.split(",")] if isinstance(argnames, str) else [*argnames]
        if asked.isdisjoint(names):
            repeats.extend(names)
            sets = [value if isinstance(value, type(pytest.param())) else pytest.param(value) for value in argvalues]
            argvalues = [one._replace(id=f"run{at}of{len(sets)}") for at, one in enumerate(sets, start=1)]
        parametrize(argnames, argvalues, *rest, **options)

    metafunc.parametrize = noting  # type: ignore[method-assign]
    return repeats


@cache  # it is asked for each name of a module
def replaced(module: ModuleType) -> str:
    """Return a sentence about claims whose tests, or their classes, have the name of a later function or class.

    That of a later claim's test is an error of `@claim(...)` already.
    """
    tests = [(name, one) for name, test in TESTS for one in (vars(test).values() if inspect.isclass(test) else (test,))]
    lines = {one.__code__.co_firstlineno: name for name, one in tests if _is_of(one, module)}
    lost, bodies = list[str](), [ast.parse(inspect.getsource(module)).body] if lines else []
    for body in bodies:
        last = {one.name: one for one in body if isinstance(one, _NAMED)}
        bodies += [one.body for one in last.values() if isinstance(one, ast.ClassDef)]
        for one in body:
            if isinstance(one, _NAMED) and one is not last[one.name]:
                first = min([one.lineno, *(mark.lineno for mark in one.decorator_list)])
                end = one.end_lineno if isinstance(one, ast.ClassDef) else first  # what a function has made may be kept
                lost += [name for line, name in lines.items() if first <= line <= (end or first)]
    which = f"the name of the test of {', '.join(lost)}, or of its class, is given again below"
    return f"{which}, so that it would never be judged: rename it." if lost else ""


_NAMED: Final = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)


def _is_of(one: Any, module: ModuleType) -> bool:
    return inspect.isfunction(one) and one.__globals__ is vars(module)


def claim_tests(items: Iterable[pytest.Item]) -> dict[pytest.Item, ClaimTest]:
    """Return what every claim test among `items` judges, after checking that their names are unique.

    A test that plugins repeat is there several times.

    Raises:
        UserError: as `ClaimTest.of` does, when two tests have the same name and tier, or when one test without
            parameters has the id of others with some.
    """
    tests = {item: ClaimTest.of(item) for item in items if item.get_closest_marker("claim")}
    first: dict[tuple[str, str], pytest.Item] = {}
    for item, test in tests.items():
        other = first.setdefault(test.key, item)
        if _call(other) != _call(item):
            tier, name = test.key
            raise UserError(
                f"Two claim tests at the {tier} tier are called {name}: {other.nodeid} and {item.nodeid}. "
                "Each would overwrite the other's verdict. Give one of them another claim id, or other "
                "parameter ids."
            )
    whole = {(test.claim.id, test.tier): item for item, test in tests.items() if not test.case}
    for item, test in tests.items():
        plain = whole.get((test.claim.id, test.tier))
        if test.case and plain:
            raise UserError(
                f"Two claim tests have the id {test.claim.id}: {plain.nodeid} without parameters, and "
                f"{item.nodeid} with some. So {test.claim.id} would name one claim and all its cases. "
                "Give one of them another claim id, or parameters to both."
            )
    return tests


def _call(item: pytest.Item) -> tuple[object, ...]:
    """Return which function an item calls with which parameters; equal for repetitions of a test."""
    repeated = item.get_closest_marker("claim_repeated")
    params: dict[str, object] = item.callspec.params  # type: ignore[attr-defined]
    own = {
        name: value if isinstance(value, str | int | float) else id(value)  # some values cannot be compared
        for name, value in params.items()
        if not (repeated and name in repeated.args)
    }
    parent = item.parent.nodeid if item.parent else ""
    return item.path, parent, getattr(item, "originalname", item.name), own


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
