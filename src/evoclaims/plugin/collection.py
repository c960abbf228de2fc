"""How claims are collected: smoke tests in their claims' places, and no claim that pytest would leave out in silence.

Nothing heavy is imported here at the top: pytest loads this file in every run of an environment that has evoclaims.
"""

from __future__ import annotations

import ast
import inspect
import os
import sys
import unittest
from collections.abc import Sequence
from fnmatch import fnmatch
from pathlib import Path

import pytest

from evoclaims.core.errors import UserError

_making: pytest.StashKey[bool] = pytest.StashKey()
"""Whether pytest itself is to make the tests of a function."""


@pytest.hookimpl(tryfirst=True)
def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> None:
    """Refuse a file in a folder of tests that has claims and a name by which pytest does not collect it."""
    if file_path.suffix != ".py" or parent.session.isinitpath(file_path):
        return
    patterns: list[str] = parent.config.getini("python_files")
    if any(fnmatch(file_path.name if os.sep not in one else str(file_path), one) for one in patterns):
        return
    from evoclaims.core.files import read_file

    try:
        text = read_file(file_path)
    except OSError:  # a folder, say
        return
    if b"evoclaims" in text and b"claim" in text and _has_claim(text):
        raise parent.CollectError(
            f"{file_path} has a test with @claim(...), and pytest collects no file of this name, so that "
            f"its claim would never be judged: put it into a file whose name is one of {' or '.join(patterns)}."
        )


def _has_claim(text: bytes) -> bool:
    """Whether a function of a file has @claim(...) or @claim.smoke(...).

    A program in a string is no function of it. One within another function may be made for the tests of other files.
    """
    try:
        nodes = [*ast.walk(ast.parse(text))]
    except (SyntaxError, ValueError):  # whoever imports it learns of that
        return False
    functions = [node for node in nodes if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]
    within = {inner for node in functions for outer in node.body for inner in ast.walk(outer)}
    own = [node for node in functions if node not in within]
    marks = [mark.func for node in own for mark in node.decorator_list if isinstance(mark, ast.Call)]
    names = [ast.unparse(mark).removesuffix(".smoke").removesuffix(".claim") for mark in marks]
    imported = [alias for node in nodes if isinstance(node, ast.Import | ast.ImportFrom) for alias in node.names]
    ours = {alias.asname or alias.name for alias in imported if alias.name in ("evoclaims", "claim")}
    return not {"claim", *ours}.isdisjoint(names)


@pytest.hookimpl(tryfirst=True)
def pytest_pycollect_makeitem(
    collector: pytest.Module | pytest.Class, name: str, obj: object
) -> Sequence[pytest.Item] | None:
    """Put smoke tests in their claims' places; refuse a claim that pytest does not collect under the run's settings."""
    if isinstance(collector, pytest.Module) and "evoclaims.claims.claim" in sys.modules:
        from evoclaims.claims.claim_names import replaced

        if lost := replaced(collector.obj):
            raise collector.CollectError(f"{collector.nodeid}: {lost}")
    if inspect.isclass(obj):
        if why := _why_left_out(collector, name, obj):
            raise collector.CollectError(
                f"{collector.nodeid}: the class {name} has @claim(...), and pytest collects {why}."
            )
        return None
    if not _is_claim(obj):
        return None
    if not (collector.funcnamefilter(name) or collector.isnosetest(obj)):
        begun = " or ".join(collector.config.getini("python_functions"))
        raise collector.CollectError(
            f"{collector.nodeid}: the function {name} has @claim(...), and pytest collects no function of this name, "
            f"so that its claim would never be judged: begin its name with {begun}."
        )
    if collector.stash.get(_making, False):
        return None
    from evoclaims.claims.smoke_tests import tests_of

    def make(name: str, obj: object) -> Sequence[pytest.Item]:
        made = collector.ihook.pytest_pycollect_makeitem(collector=collector, name=name, obj=obj)
        return made if isinstance(made, list) else [*filter(None, [made])]

    collector.stash[_making] = True
    try:
        return tests_of(name, collector.obj, make)
    except UserError as error:
        raise collector.CollectError(f"{collector.nodeid}: {error}") from error
    finally:
        collector.stash[_making] = False


def _is_claim(obj: object) -> bool:
    """Whether something in a module or a class is a function with @claim(...)."""
    obj = obj.__func__ if isinstance(obj, staticmethod | classmethod) else obj
    return inspect.isfunction(obj) and any(mark.name == "claim" for mark in getattr(obj, "pytestmark", ()))


def _why_left_out(collector: pytest.Module | pytest.Class, name: str, one: type) -> str:
    """Return why pytest collects no tests from a class with claims, neither its own nor as those of an heir."""
    if not getattr(one, "__test__", True) or issubclass(one, unittest.TestCase):
        return ""
    lost = "so that its claim would never be judged"
    here = one.__module__ == collector.module.__name__
    is_test = collector.classnamefilter(name) or collector.isnosetest(one)
    if here and not is_test and _has_claims(one) and not one.__subclasses__():
        begun = " or ".join(collector.config.getini("python_classes"))
        return f"no class of this name, {lost}: begin its name with {begun}"
    if not is_test or not any(map(_has_claims, one.__mro__)):
        return ""
    if inspect.isabstract(one):
        return "" if one.__subclasses__() else f"no abstract class, {lost}: write a subclass of it"
    made = [word for word in ("__init__", "__new__") if getattr(one, word) is not getattr(object, word)]
    return f"no class with {made[0]}, {lost}: use fixtures instead" if made else ""


def _has_claims(one: type) -> bool:
    """Whether a class has @claim(...), or a function with it."""
    marks = vars(one).get("pytestmark", ())
    is_claim = isinstance(marks, list) and any(getattr(mark, "name", "") == "claim" for mark in marks)
    return is_claim or any(map(_is_claim, vars(one).values()))
