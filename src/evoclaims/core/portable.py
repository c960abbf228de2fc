"""Frozen dataclasses and functions as JSON, from which another process makes equal ones; nothing is pickled."""

from __future__ import annotations

import dataclasses
import importlib
import math
from functools import reduce
from typing import Any, Final

from evoclaims.core.errors import UserError

_PLAIN: Final = (str, int, float, bool, type(None))


def reference(value: Any) -> str:
    """Return where a class or function is defined, as "module:name".

    Raises:
        UserError: when another process cannot import it: a lambda, what a function defines, or what a script does.
    """
    module, name = getattr(value, "__module__", None), getattr(value, "__qualname__", None)
    if not module or not name or module == "__main__" or "<" in name:
        raise UserError(
            f"{name or value!r} cannot be imported by another process. Define it under its own name in a module, not "
            "inside a function or in a script."
        )
    try:
        found = resolve(named := f"{module}:{name}")
    except (ImportError, AttributeError) as error:  # a class that was made while the program ran
        raise UserError(
            f"{named} cannot be imported by another process: {error}. Define it in a module, outside functions and "
            "classes."
        ) from error
    if found != value:  # a method of one object, or a function that a decorator has replaced
        raise UserError(
            f"Another process that imports {named} finds {found!r} there, not {value!r}. Give each its own name in "
            "the module."
        )
    return named


def resolve(named: str) -> Any:
    """Return the class or function at "module:name"; raise an ImportError or AttributeError if it is not there."""
    module, _, name = named.partition(":")
    return reduce(getattr, name.split("."), importlib.import_module(module))


def to_plain(value: Any) -> Any:
    """Return JSON from which `from_plain` makes an equal value.

    Raises:
        UserError: for anything but dataclasses, classes, functions, tables, lists, tuples and plain values.
    """
    if isinstance(value, float) and not math.isfinite(value):  # which JSON has no words for
        return {"float": repr(float(value))}
    if isinstance(value, _PLAIN):
        return value
    if isinstance(value, list):
        return [to_plain(item) for item in value]
    if isinstance(value, tuple):
        return {"tuple": [to_plain(item) for item in value]}
    if isinstance(value, dict):
        return {"dict": [[to_plain(key), to_plain(item)] for key, item in value.items()]}
    if isinstance(value, type) or (callable(value) and hasattr(value, "__qualname__")):
        return {"import": reference(value)}
    if dataclasses.is_dataclass(value):
        fields = {field.name: getattr(value, field.name) for field in dataclasses.fields(value) if field.init}
        return {"class": reference(type(value)), "fields": {name: to_plain(item) for name, item in fields.items()}}
    raise UserError(f"A {type(value).__name__} cannot be passed to another process. Use a frozen dataclass.")


def from_plain(plain: Any) -> Any:
    """Return the value that `to_plain` was given."""
    if isinstance(plain, list):
        return [from_plain(item) for item in plain]
    if not isinstance(plain, dict):
        return plain
    if "float" in plain:
        return float(plain["float"])
    if "tuple" in plain:
        return tuple(map(from_plain, plain["tuple"]))
    if "dict" in plain:
        return {from_plain(key): from_plain(item) for key, item in plain["dict"]}
    if "import" in plain:
        return resolve(plain["import"])
    return resolve(plain["class"])(**{name: from_plain(item) for name, item in plain["fields"].items()})
