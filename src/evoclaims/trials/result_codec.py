"""A trial record as text: written with a seal, and checked against its schema when it is read.

A seal shows that a record was not changed, but not that this program wrote it. The rest of the code relies on
everything that the schema declares.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import re
from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal, NoReturn, cast

from msgspec import Meta, Struct, ValidationError, convert

from evoclaims.core.canonical import as_plain, canonical_json, content_hash
from evoclaims.core.errors import UserError
from evoclaims.core.printable import printable
from evoclaims.trials.result import COMPLETE, SHARES, Status, TrialResult, is_share

DEEPEST: Final = 64
"""Maximum nesting of objects and lists in the free JSON parts of a record."""

LONGEST_REASON: Final = 300
"""Most characters of a reason."""

LONGEST_SECONDS: Final = 1e10
"""Three hundred years: a longer time is an error; sums of shorter times stay finite."""

Hash = Annotated[str, Meta(pattern=r"\A[0-9a-f]{64}\Z")]
Number = int | float | Literal["nan", "inf", "-inf"]
Vector = tuple[Number, ...]
Seconds = Annotated[float, Meta(ge=0, le=LONGEST_SECONDS)]
Count = Annotated[float, Meta(ge=0, le=2**53)]
Table = dict[str, Any]


class Record(Struct):
    """All fields of a record: those of `TrialResult`, and those about the file itself."""

    schema: int
    seal: Hash
    id: Hash
    condition: Hash
    spec: Table
    seed: Annotated[int, Meta(ge=0, lt=2**31)]
    status: Status
    metrics: dict[str, Number]
    levels: dict[str, Vector]
    curves: dict[str, Vector]
    digest: Hash
    timing: Table
    provenance: Table
    champion: Annotated[str, Meta(pattern=r"\A([0-9a-f]{64})?\Z")]


class Metrics(Struct):
    """The metrics of every trial that ran to its end (see `result_making.make_result`); tasks add their own."""

    mean_success: Number
    last_success: Number
    last_fitness: Number
    furthest_solved: Number
    furthest_reached: Number
    steps: Count
    environment_steps: Count


class Levels(Struct):
    """The vectors over levels of every trial that ran to its end."""

    success: Annotated[Vector, Meta(min_length=1)]
    fitness: Annotated[Vector, Meta(min_length=1)]


class Timing(Struct):
    """How long a batch of trials took."""

    run: Seconds
    compile: Seconds
    batch: Annotated[int, Meta(ge=1)]
    started: str
    ended: str = ""
    processor: Seconds | None = None


class Device(Struct):
    """What a trial was computed on."""

    platform: str
    kind: str
    count: int = 1


class GitState(Struct):
    """The state of the code."""

    sha: str | None = None
    dirty: bool | None = None


class Spec(Struct):
    """The parts of a specification that are read back from a record."""

    method: Table | None = None
    task: Table | None = None
    imported: Table | None = None


class Provenance(Struct):
    """Where a trial came from; records of earlier releases have fewer fields."""

    git: GitState | None = None
    versions: dict[str, str | None] | None = None
    depends_on: list[str] | None = None
    code_hashes: dict[str, str] | None = None
    cuda: dict[str, str] | None = None
    device: Device | None = None
    imported: Table | None = None
    machine: str | None = None
    instructions: str | None = None
    xla_flags: str | None = None
    matmul_precision: str | None = None
    x64: bool | None = None


class RecordError(UserError):
    """A text is not a valid trial record; `reason` is a clause that says why, `later` if it is of a later schema."""

    def __init__(self, reason: str, *, later: bool = False) -> None:
        """Store `reason` for a caller that knows the file name."""
        self.reason = printable(reason)[:LONGEST_REASON]
        self.later = later
        super().__init__(f"This is not a sound trial record: {self.reason}.")


def check(plain: dict[str, Any]) -> Record:
    """Return the fields of a record with their types checked.

    Args:
        plain: the record as read from JSON; its integers must fit into a float.

    Raises:
        RecordError: naming the first field that does not fit the schema.
    """
    _check_depth([plain["spec"], plain["timing"], plain["provenance"]])
    record: Record = _fitted(plain, Record, "")
    _fitted(record.spec, Spec, "spec")
    _fitted(record.timing, Timing, "timing")
    _fitted(record.provenance, Provenance, "provenance")
    if record.status in COMPLETE and "imported" not in record.spec:  # another program has its own metrics
        _fitted(record.metrics, Metrics, "metrics")
        _fitted(record.levels, Levels, "levels")
    _check_successes(record)
    if len({len(curve) for curve in record.curves.values()}) > 1:
        raise RecordError("its curves are not equally long")
    return record


def _check_successes(record: Record) -> None:
    """Reject successes that are no shares: no run and no import stores such a record."""
    found: dict[str, Vector] = {name: (record.metrics[name],) for name in SHARES if name in record.metrics}
    for name, vectors in (("levels", record.levels), ("curves", record.curves)):
        found |= {f"{name} success": vectors["success"]} if "success" in vectors else {}
    for name, values in found.items():
        for value in values:
            if not isinstance(value, str) and not is_share(value):  # what is not finite is a word
                raise RecordError(f"its {name} of {value:g} is no success, a share from 0 to 1")


def _fitted(value: Any, kind: Any, name: str) -> Any:
    """Return `value` as a `kind`; `name` is the field that contains it, empty for the record itself."""
    try:
        return convert(value, kind)
    except ValidationError as error:
        problem, _, path = str(error).partition(" - at `$")
        place = f"{name}{path.rstrip('`')}".lstrip(".").replace("[...]", "")
        raise RecordError(f"its {place or 'contents'} field is not as the schema says: {problem}") from error
    except UnicodeEncodeError as error:
        raise RecordError(f"a name in its {name} field is no text") from error


def _check_depth(level: list[Any]) -> None:
    """Reject values nested so deeply that walking through them would overflow the interpreter's stack."""
    for _ in range(DEEPEST):
        tables = [value.values() if isinstance(value, dict) else value for value in level if type(value) in _NESTING]
        if not tables:
            return
        level = [item for table in tables for item in table]
    raise RecordError(f"it is nested too deeply: more than {DEEPEST} levels")


_NESTING: Final = frozenset((dict, list))


SCHEMA: Final = 1
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
    """Return the record of `result` with its seal, a hash of the rest: one line of canonical JSON."""
    plain: dict[str, Any] = {"schema": SCHEMA, **as_plain(result)}
    return canonical_json({**plain, "seal": content_hash(plain)}).encode("ascii") + b"\n"


def parse(data: bytes | str) -> TrialResult:
    """Return the trial that the JSON text `data` records; the inverse of `dump`.

    Raises:
        RecordError: when the text is torn, edited, of another schema, or has a field of the wrong type.
    """
    data = data.encode(errors="replace") if isinstance(data, str) else data
    plain = _load(data)
    schema = plain.get("schema")
    if schema != SCHEMA or isinstance(schema, bool):
        reason = f"its schema is {schema!r} and this version of evoclaims reads schema {SCHEMA}"
        raise RecordError(reason, later=isinstance(schema, int) and schema > SCHEMA)
    if plain.keys() != _FIELDS:
        raise RecordError(f"these fields are missing or unknown: {', '.join(sorted(plain.keys() ^ _FIELDS))}")
    if not _is_sealed(data, plain):
        raise RecordError("its contents do not match its seal, so it was torn or edited")
    record = check(plain)
    spec = record.spec
    if type(spec.get("seed")) is not int or spec["seed"] != record.seed:
        raise RecordError("its seed does not agree with its specification")
    if _hash_of_json(spec) != record.id:
        raise RecordError("its id is not the hash of its specification")
    if _hash_of_json({key: value for key, value in spec.items() if key != "seed"}) != record.condition:
        raise RecordError("its condition is not the hash of its specification without the seed")
    fields: dict[str, Any] = {name: getattr(record, name) for name in _FIELDS - {"schema", "seal"}}
    fields["metrics"] = {name: _number(value) for name, value in record.metrics.items()}
    return TrialResult(**{**fields, "levels": _vectors(record.levels), "curves": _vectors(record.curves)})


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
    except (ValueError, RecursionError) as error:
        raise RecordError("it is not one whole JSON text") from error
    if not isinstance(plain, dict):
        raise RecordError("it is not a JSON object")
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
    vectors: dict[str, tuple[float, ...]] = {}
    for name, values in fields.items():
        worded = str in set(map(type, values))  # rarely
        vectors[name] = tuple(map(_number, values)) if worded else cast(tuple[float, ...], values)
    return vectors


def _number(value: Number) -> float:
    return _WORDS[value] if isinstance(value, str) else value


def _hash_of_json(plain: Any) -> str:
    """Return `content_hash` of what was read from JSON, which does not need `as_plain`."""
    try:
        return hashlib.sha256(_ENCODER.encode(plain).encode("ascii")).hexdigest()
    except RecursionError as error:
        raise RecordError("it is nested too deeply") from error
    except ValueError as error:  # 1e999, which Python reads as infinite and the seal would confuse with "inf"
        raise RecordError("a number in it is too large") from error
