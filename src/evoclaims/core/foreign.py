"""Calling libraries that rely on jax's implicit promotions, or import more than is used here."""

from __future__ import annotations

import contextlib
import importlib
import io
import sys
import threading
from collections.abc import Iterator
from types import ModuleType
from typing import Any, Final

import jax

_importing: Final = threading.RLock()


class Later(ModuleType):
    """A module that is imported when one of its names is first asked for: some take a second.

    That may be while a program is traced, so constants of the module are made outside of it. What the import prints is
    dropped: MJX's has two lines where NVIDIA's warp is not installed.
    """

    def __getattr__(self, name: str) -> Any:
        """Return what the module has of this name."""
        if name.startswith("__"):  # who looks at all that a module names need not wait for this one
            raise AttributeError(name)
        with _importing:
            if self.__name__ not in sys.modules:
                with jax.ensure_compile_time_eval(), contextlib.redirect_stdout(io.StringIO()):
                    importlib.import_module(self.__name__)
        return getattr(importlib.import_module(self.__name__), name)


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
