"""Packages whose names are imported on first use, so that importing the package itself is cheap.

`lazy_loader` does the same from the same stubs, but is not worth a dependency for these few lines.
"""

from __future__ import annotations

import ast
import importlib
import sys
from collections.abc import Callable
from pathlib import Path


def exported(package: str) -> tuple[list[str], Callable[[str], object], Callable[[], list[str]]]:
    """Return `__all__`, `__getattr__` and `__dir__` of a package, read from the `__init__.pyi` beside `__init__.py`.

    The stub, which type checkers and editors also read, is a list of `from MODULE import NAME as NAME`.
    """
    module = sys.modules[package]
    stub = Path(str(module.__file__)).with_suffix(".pyi").read_text(encoding="utf-8")
    lines = [line for line in ast.parse(stub).body if isinstance(line, ast.ImportFrom)]
    homes = {alias.name: str(line.module) for line in lines for alias in line.names}

    def load(name: str) -> object:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}", name=name, obj=module)
        return getattr(importlib.import_module(homes[name]), name)  # not cached: a re-import makes another class

    return sorted(homes), load, lambda: sorted({*vars(module), *homes})
