"""Claims that pytest would collect no test for: refused, so that none is forgotten in silence.

Nothing heavy is imported here at the top: pytest loads this file in every run of an environment that has evoclaims.
"""

from __future__ import annotations

import inspect
import unittest

import pytest


@pytest.hookimpl(tryfirst=True)
def pytest_pycollect_makeitem(collector: pytest.Module | pytest.Class, name: str, obj: object) -> None:
    """Refuse a claim on a function, or in a class, that pytest does not collect under the run's settings."""
    if inspect.isclass(obj):
        if any(map(_is_claim, vars(obj).values())) and _is_left_out(collector, name, obj):
            begun = " or ".join(collector.config.getini("python_classes"))
            raise collector.CollectError(
                f"{collector.nodeid}: the class {name} has a function with @claim(...), and pytest takes none of this "
                f"name for one of tests, so that its claim would never be judged: begin its name with {begun}."
            )
        return
    if not inspect.isfunction(obj) or collector.funcnamefilter(name):
        return
    if _is_claim(obj):
        begun = " or ".join(collector.config.getini("python_functions"))
        raise collector.CollectError(
            f"{collector.nodeid}: the function {name} has @claim(...), and pytest takes none of this name for a test, "
            f"so that its claim would never be judged: begin its name with {begun}."
        )


def _is_claim(obj: object) -> bool:
    """Whether something in a module or a class is a function with @claim(...)."""
    return inspect.isfunction(obj) and any(mark.name == "claim" for mark in getattr(obj, "pytestmark", ()))


def _is_left_out(collector: pytest.Module | pytest.Class, name: str, one: type) -> bool:
    """Whether pytest collects no tests from a class that was written here: neither its own nor as those of an heir."""
    return (
        one.__module__ == collector.module.__name__
        and getattr(one, "__test__", True)
        and not collector.classnamefilter(name)
        and not issubclass(one, unittest.TestCase)
        and not one.__subclasses__()
    )
