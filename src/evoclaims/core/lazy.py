"""Packages whose names are imported when they are first asked for, so that importing the package costs nothing.

By hand and without `lazy_loader`, which does the same from the same stubs: it would be a dependency for these lines.
"""

from __future__ import annotations

import ast
import importlib
import sys
from collections.abc import Callable
from pathlib import Path


def exported(package: str) -> tuple[list[str], Callable[[str], object], Callable[[], list[str]]]:
    """Return `__all__`, `__getattr__` and `__dir__` of a package, as `__init__.pyi` beside its `__init__.py` says.

    The stub, which is what type checkers and editors read, is a list of `from MODULE import NAME as NAME`.
    """
    module = sys.modules[package]
    stub = Path(str(module.__file__)).with_suffix(".pyi").read_text(encoding="utf-8")
    lines = [line for line in ast.parse(stub).body if isinstance(line, ast.ImportFrom)]
    homes = {alias.name: str(line.module) for line in lines for alias in line.names}

    def load(name: str) -> object:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}", name=name, obj=module)
        return getattr(importlib.import_module(homes[name]), name)  # not kept: what is imported anew is another class

    return sorted(homes), load, lambda: sorted({*vars(module), *homes})
