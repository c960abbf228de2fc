"""Calling libraries that rely on jax's implicit promotions, or import more than is used here."""

from __future__ import annotations

import contextlib
import importlib
import sys
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import jax


@contextlib.contextmanager
def implicit_promotions() -> Iterator[None]:
    """Allow implicit promotion of dtype and rank while another library's functions are called or traced."""
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        yield


@contextlib.contextmanager
def imported_when_called(module: str, name: str) -> Iterator[None]:
    """Let `from module import name` give a function that imports the module only when it is called."""
    if module in sys.modules:
        yield
        return

    def called(*arguments: Any, **options: Any) -> Any:
        return getattr(importlib.import_module(module), name)(*arguments, **options)

    stand_in = ModuleType(module)
    setattr(stand_in, name, called)
    sys.modules[module] = stand_in
    try:
        yield
    finally:
        del sys.modules[module]
