"""Claims that pytest would collect no test for: refused, so that none is forgotten in silence.

Nothing heavy is imported here at the top: pytest loads this file in every run of an environment that has evoclaims.
"""

from __future__ import annotations

import inspect

import pytest


@pytest.hookimpl(tryfirst=True)
def pytest_pycollect_makeitem(collector: pytest.Module | pytest.Class, name: str, obj: object) -> None:
    """Refuse a claim on a function whose name is none of a test, by the settings of the run."""
    if not inspect.isfunction(obj) or collector.funcnamefilter(name):
        return
    if any(mark.name == "claim" for mark in getattr(obj, "pytestmark", ())):
        begun = " or ".join(collector.config.getini("python_functions"))
        raise collector.CollectError(
            f"{collector.nodeid}: the function {name} has @claim(...), and pytest takes none of this name for a test, "
            f"so that its claim would never be judged: begin its name with {begun}."
        )
