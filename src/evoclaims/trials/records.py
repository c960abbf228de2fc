"""A trial record as text: written sealed, read back with every field checked, since text is not to be trusted."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import re
from collections.abc import Mapping
from typing import Any, Final, NoReturn, cast

from evoclaims.core.canonical import canonical_json
from evoclaims.core.errors import UserError
from evoclaims.trials.result import SCHEMA, STATUSES, Status, TrialResult

_HASH: Final = re.compile(r"[0-9a-f]{64}")
_WORDS: Final = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}
_LONGEST: Final = 300
_FIELDS: Final = {field.name for field in dataclasses.fields(TrialResult)} | {"schema", "seal"}


class RecordError(UserError):
    """A text is not a sound trial record; `reason` is a clause that says why."""

    def __init__(self, reason: str) -> None:
        """Keep `reason` for a caller that knows the file's name."""
        super().__init__(f"This is not a sound trial record: {reason}.")
        self.reason = reason


def is_hash(text: object) -> bool:
    """Whether `text` is 64 lower-case hexadecimal digits, as every id, digest and seal is."""
    return isinstance(text, str) and _HASH.fullmatch(text) is not None


def printable(text: object) -> str:
    """Return `text` with control characters and stray surrogates escaped: safe to print to any terminal."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in str(text))


def dump(result: TrialResult) -> bytes:
    """Return the sealed record of `result`: one line of canonical JSON."""
    return canonical_json(result.to_json()).encode("ascii") + b"\n"


def parse(data: bytes | str) -> TrialResult:
    """Return the trial that the JSON text `data` records; the inverse of `dump`.

    Raises:
        RecordError: when the text is torn, edited, of another schema, or has a field of the wrong type.
    """
    plain = _load(data)
    if plain.get("schema") != SCHEMA or isinstance(plain.get("schema"), bool):
        _fail(f"its schema is {plain.get('schema')!r} and this version of evoclaims reads schema {SCHEMA}")
    if plain.keys() != _FIELDS:
        _fail(f"these fields are missing or unknown: {', '.join(sorted(plain.keys() ^ _FIELDS))}")
    if _seal(plain) != plain["seal"]:
        _fail("its contents do not match its seal, so it was torn or edited")
    spec = _mapping(plain, "spec")
    seed = plain["seed"]
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0 or spec.get("seed") != seed:
        _fail("its seed is not a whole number from 0 up that agrees with its specification")
    if _hash_of_json(spec) != plain["id"]:
        _fail("its id is not the hash of its specification")
    if _hash_of_json({key: value for key, value in spec.items() if key != "seed"}) != plain["condition"]:
        _fail("its condition is not the hash of its specification without the seed")
    if plain["status"] not in STATUSES:
        _fail(f"its status is {plain['status']!r}; known: {', '.join(STATUSES)}")
    if not is_hash(plain["digest"]):
        _fail("its digest is not a hash")
    if plain["champion"] != "" and not is_hash(plain["champion"]):
        _fail("its champion is not a hash")
    curves = _vectors(plain, "curves")
    if len({len(curve) for curve in curves.values()}) > 1:
        _fail("its curves are not equally long")
    return TrialResult(
        id=plain["id"],
        condition=plain["condition"],
        spec=spec,
        seed=seed,
        status=cast(Status, plain["status"]),
        metrics={name: _number(value, "metrics") for name, value in _mapping(plain, "metrics").items()},
        levels=_vectors(plain, "levels"),
        curves=curves,
        digest=plain["digest"],
        timing=_mapping(plain, "timing"),
        provenance=_mapping(plain, "provenance"),
        champion=plain["champion"],
    )


def _fail(reason: str) -> NoReturn:
    """Raise `RecordError`."""
    raise RecordError(printable(reason)[:_LONGEST])


def _seal(plain: dict[str, Any]) -> str:
    """Return the seal that the contents of a record call for."""
    try:
        return _hash_of_json({key: value for key, value in plain.items() if key != "seal"})
    except RecursionError:
        _fail("it is nested too deeply")
    except ValueError:  # 1e999, which Python reads as infinite and which would pass for "inf" under the seal
        _fail("a number in it is too large")


def _load(data: bytes | str) -> dict[str, Any]:
    """Return the JSON object in `data`; refuse what JSON forbids but Python's reader lets through."""
    try:
        text = data if isinstance(data, str) else data.decode("utf-8")
        plain = json.loads(text, parse_constant=_no_constant, object_pairs_hook=_unique)
    except (ValueError, RecursionError):
        _fail("it is not one whole JSON text")
    if not isinstance(plain, dict):
        _fail("it is not a JSON object")
    return plain


def _no_constant(word: str) -> NoReturn:
    """Refuse the bare words NaN and Infinity, which are not JSON."""
    raise ValueError(word)


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Refuse an object that names a key twice, of which Python would keep the last."""
    plain = dict(pairs)
    if len(plain) != len(pairs):
        raise ValueError("a key is named twice")
    return plain


def _mapping(plain: Mapping[str, Any], field: str) -> dict[str, Any]:
    """Return the JSON object in `field`."""
    value = plain[field]
    if not isinstance(value, dict):
        _fail(f"its {field} field is not a JSON object")
    return value


def _vectors(plain: Mapping[str, Any], field: str) -> dict[str, tuple[float, ...]]:
    """Return the named lists of numbers in `field`."""
    vectors = {}
    for name, values in _mapping(plain, field).items():
        if not isinstance(values, list):
            _fail(f"{name!r} in its {field} is not a list of numbers")
        plain_floats = set(map(type, values)) <= {float}  # nearly always; the rest is looked at one by one
        vectors[name] = tuple(values) if plain_floats else tuple(_number(value, field) for value in values)
    return vectors


def _number(value: Any, field: str) -> float:
    """Return a number, with "nan", "inf" and "-inf" turned back into floats."""
    if isinstance(value, str) and value in _WORDS:
        return _WORDS[value]
    if isinstance(value, bool) or not isinstance(value, int | float):
        _fail(f"{value!r} in its {field} is not a number")
    return value


def _hash_of_json(plain: Any) -> str:
    """Return `content_hash` of what was read from JSON, which has no need of `as_plain`.

    Raises:
        ValueError: for an infinite number.
    """
    text = json.dumps(plain, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode("ascii")).hexdigest()
