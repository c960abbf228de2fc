"""Canonical JSON and content hashes: the same value always gives the same bytes and the same name."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import inspect
import json
import math
import re
from typing import Any, Final

from evoclaims.core.errors import UserError

WHOLE: Final = re.compile(r"int|tuple\[int(, (int|\.\.\.))*\]")
"""Annotations of fields that take no float: int, and tuples of ints."""

_UNCHANGED: Final = frozenset((type(None), bool, int, str))
"""Types whose values are JSON as they are."""


def as_plain(value: Any) -> Any:
    """Turn frozen dataclasses, tuples and scalars into plain JSON values.

    A dataclass becomes its fields, and the name of its class if that is not of this package, where no two with the
    same fields mean different things. Fields whose metadata holds `canonical=False` are left out, and those with
    `canonical="if set"` where they have their default: such a field may be added to a released class. NaN and the
    infinities become the strings "nan", "inf", "-inf", since JSON cannot express them.

    Raises:
        TypeError: for a value without a canonical form (an array, a function, a set, a key that is not a string).
    """
    exact = type(value)
    if exact in _UNCHANGED:  # most values: nothing slower is asked of them
        return value
    if exact is tuple or exact is list:  # what `isinstance` finds below, sooner
        return [as_plain(item) for item in value]
    if exact is not float and exact is not dict and dataclasses.is_dataclass(value) and not isinstance(value, type):
        kind = {} if is_own(type(value)) else {"class": type(value).__qualname__}
        return {**kind, **fields_of(value)}
    if isinstance(value, dict):
        for key in value:
            if type(key) is not str and not isinstance(key, str):  # JSON would write 1 and "1" alike
                raise TypeError(f"a key of type {type(key).__name__} has no canonical JSON form: {key!r}")
        return {key: item if type(item) in _UNCHANGED else as_plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [as_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return repr(float(value))
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise TypeError(f"{type(value).__name__} has no canonical JSON form: {value!r}")


def fields_of(value: Any) -> dict[str, Any]:
    """Return the fields of a dataclass as plain JSON values."""
    found = ((field, getattr(value, field.name)) for field in _canonical_fields(value.__class__))
    return {
        field.name: as_plain(held)
        for field, held in found
        if field.metadata.get("canonical") != "if set" or held != field.default
    }


@functools.cache
def _canonical_fields(kind: type) -> tuple[dataclasses.Field[Any], ...]:
    return tuple(field for field in dataclasses.fields(kind) if field.metadata.get("canonical", True))


def require_numbers(value: Any) -> None:
    """Refuse what is no number, or no truth, for a field of a dataclass, or of one among its fields.

    That is a float where an int is declared, since 16.0 would have another id than 16; anything but True and False
    where a bool is, since "no" is true to Python; and NaN, for which no comparison holds: checks such as `std <= 0` let
    it pass, and a goal within NaN is never reached. Refuse also what is kept of an argument beside the fields.

    Raises:
        UserError: naming the field.
    """
    if type(value) in _UNCHANGED or not dataclasses.is_dataclass(value) or isinstance(value, type):
        return
    if (others := _other_arguments(type(value))) and (kept := _kept_beside_fields(value)):
        raise UserError(
            f"{type(value).__name__} keeps {', '.join(kept)}, and is given {', '.join(others)}, which are no fields of "
            "it: whatever their values, trials would have one id. Make them fields, such as `scale: float = 1.0`."
        )
    for name, declared, is_whole in _declared(type(value)):
        given = getattr(value, name)
        items = given if isinstance(given, tuple) else (given,)
        if is_whole and any(isinstance(item, float) for item in items):
            raise UserError(
                f"{type(value).__name__} has {name}={given!r}. Write whole numbers without a decimal point "
                f"({declared})."
            )
        if declared == "bool" and not isinstance(given, bool):
            raise UserError(f"{type(value).__name__} has {name}={given!r}. Write True or False.")
        if any(isinstance(item, float) and math.isnan(item) for item in items):
            raise UserError(f"{type(value).__name__} has {name}={given!r}. Write a number in place of nan.")
        for item in items:
            if type(item) not in _UNCHANGED:
                require_numbers(item)


@functools.cache
def _other_arguments(kind: type) -> tuple[str, ...]:
    """Return what a dataclass takes that is none of its fields: an `InitVar`, or arguments of its own `__init__`."""
    fields = {field.name for field in dataclasses.fields(kind)}
    return tuple(name for name in inspect.signature(kind).parameters if name not in fields)


def _kept_beside_fields(value: Any) -> list[str]:
    """Return the names of what a dataclass holds and that is neither a field nor a cached property."""
    fields = {field.name for field in dataclasses.fields(value)}
    held = (name for name in getattr(value, "__dict__", {}) if name not in fields)
    return [name for name in held if not isinstance(getattr(type(value), name, None), functools.cached_property)]


@functools.cache
def _declared(kind: type) -> tuple[tuple[str, str, bool], ...]:
    """Return the names of a dataclass's fields, how they are declared, and whether that is as whole numbers."""
    types = {one.name: one.type for one in dataclasses.fields(kind)}
    words = {name: one if isinstance(one, str) else inspect.formatannotation(one) for name, one in types.items()}
    return tuple((name, word, WHOLE.fullmatch(word) is not None) for name, word in words.items())


def is_own(one: Any) -> bool:
    """Whether a class, a function or a module is of this package."""
    module: str = getattr(one, "__module__", None) or one.__name__
    return module.partition(".")[0] == __name__.partition(".")[0]


def canonical_json(value: Any) -> str:
    """Return `value` as JSON with sorted keys and no spaces, in ASCII."""
    return json.dumps(as_plain(value), sort_keys=True, separators=(",", ":"), allow_nan=False)


def content_hash(value: Any) -> str:
    """Return the SHA-256 of the canonical JSON of `value`, as 64 hexadecimal digits."""
    return hashlib.sha256(canonical_json(value).encode("ascii")).hexdigest()
