"""A trial record as text: written with a seal; reading checks every field, since text is not trusted."""

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
from evoclaims.trials.result import SCHEMA, TrialResult
from evoclaims.trials.result_schema import Number, RecordError, Vector, check

_HASH: Final = re.compile(r"[0-9a-f]{64}")
_WORDS: Final = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}
_MOST_DIGITS: Final = 19
_ENCODER: Final = json.JSONEncoder(sort_keys=True, separators=(",", ":"), allow_nan=False)
_FIELDS: Final = {field.name for field in dataclasses.fields(TrialResult)} | {"schema", "seal"}


def is_hash(text: object) -> bool:
    """Whether `text` is 64 lower-case hexadecimal digits, as every id, digest and seal is."""
    return isinstance(text, str) and _HASH.fullmatch(text) is not None


def checked_id(text: str, of: str) -> str:
    """Return the id of a trial or a condition (`of`) as it is; any other text might be a path outside of the store."""
    if not is_hash(text):
        raise UserError(f"{text!r} is not a {of}'s id: an id is 64 lower-case hexadecimal digits.")
    return text


def dump(result: TrialResult) -> bytes:
    """Return the sealed record of `result`: one line of canonical JSON."""
    return canonical_json(result.to_json()).encode("ascii") + b"\n"


def parse(data: bytes | str) -> TrialResult:
    """Return the trial that the JSON text `data` records; the inverse of `dump`.

    Raises:
        RecordError: when the text is torn, edited, of another schema, or has a field of the wrong type.
    """
    data = data.encode(errors="replace") if isinstance(data, str) else data
    plain = _load(data)
    if plain.get("schema") != SCHEMA or isinstance(plain.get("schema"), bool):
        _fail(f"its schema is {plain.get('schema')!r} and this version of evoclaims reads schema {SCHEMA}")
    if plain.keys() != _FIELDS:
        _fail(f"these fields are missing or unknown: {', '.join(sorted(plain.keys() ^ _FIELDS))}")
    if not _is_sealed(data, plain):
        _fail("its contents do not match its seal, so it was torn or edited")
    record = check(plain)
    spec = record.spec
    if type(spec.get("seed")) is not int or spec["seed"] != record.seed:
        _fail("its seed does not agree with its specification")
    if _hash_of_json(spec) != record.id:
        _fail("its id is not the hash of its specification")
    if _hash_of_json({key: value for key, value in spec.items() if key != "seed"}) != record.condition:
        _fail("its condition is not the hash of its specification without the seed")
    fields: dict[str, Any] = {name: getattr(record, name) for name in _FIELDS - {"schema", "seal"}}
    fields["metrics"] = {name: _number(value) for name, value in record.metrics.items()}
    return TrialResult(**{**fields, "levels": _vectors(record.levels), "curves": _vectors(record.curves)})


def _fail(reason: str) -> NoReturn:
    """Raise `RecordError`."""
    raise RecordError(reason)


def _is_sealed(data: bytes, plain: dict[str, Any]) -> bool:
    """Whether a record matches its seal, in the exact bytes of `dump` or in equivalent JSON."""
    seal: object = plain["seal"]
    if not is_hash(seal):
        return False
    written = data.strip().replace(f'"seal":"{seal}",'.encode(), b"", 1)
    if hashlib.sha256(written).hexdigest() == seal:
        return True
    return _hash_of_json({key: value for key, value in plain.items() if key != "seal"}) == seal


def _load(data: bytes) -> dict[str, Any]:
    """Return the JSON object in `data`; reject what JSON forbids but Python's reader accepts."""
    try:
        plain = json.loads(
            data.decode("utf-8"), parse_int=_whole, parse_constant=_no_constant, object_pairs_hook=_unique
        )
    except (ValueError, RecursionError):
        _fail("it is not one whole JSON text")
    if not isinstance(plain, dict):
        _fail("it is not a JSON object")
    return plain


def _no_constant(word: str) -> NoReturn:
    """Reject the bare words NaN and Infinity, which are not JSON."""
    raise ValueError(word)


def _whole(digits: str) -> int:
    """Reject integers that no counter and no float can hold."""
    if len(digits.lstrip("-")) > _MOST_DIGITS:
        raise ValueError("a whole number is too large")
    return int(digits)


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Reject an object with a repeated key; Python would keep only the last."""
    plain = dict(pairs)
    if len(plain) != len(pairs):
        raise ValueError("a key is named twice")
    return plain


def _vectors(fields: Mapping[str, Vector]) -> dict[str, tuple[float, ...]]:
    """Return named vectors of floats."""
    vectors: dict[str, tuple[float, ...]] = {}
    for name, values in fields.items():
        worded = str in set(map(type, values))  # rarely
        vectors[name] = tuple(map(_number, values)) if worded else cast(tuple[float, ...], values)
    return vectors


def _number(value: Number) -> float:
    """Return a number, with "nan", "inf" and "-inf" turned back into floats."""
    return _WORDS[value] if isinstance(value, str) else value


def _hash_of_json(plain: Any) -> str:
    """Return `content_hash` of what was read from JSON, which does not need `as_plain`."""
    try:
        return hashlib.sha256(_ENCODER.encode(plain).encode("ascii")).hexdigest()
    except RecursionError:
        _fail("it is nested too deeply")
    except ValueError:  # 1e999, which Python reads as infinite and the seal would confuse with "inf"
        _fail("a number in it is too large")
