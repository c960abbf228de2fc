"""What the fields of a trial record are: the one schema that a record is checked against when it is read.

A seal says that a record is as its writer left it, and not that the writer was this program. What is declared here is
what the rest of the code takes for granted of every record.
"""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal

from msgspec import Meta, Struct, ValidationError, convert

from evoclaims.trials.result import COMPLETE, Status

DEEPEST: Final = 64
"""Most levels of tables and lists in the parts of a record that are free JSON."""

LONGEST_SECONDS: Final = 1e10
"""Three hundred years: beyond it a time is a mistake, and sums of such times are still finite."""

Hash = Annotated[str, Meta(pattern=r"\A[0-9a-f]{64}\Z")]
Number = int | float | Literal["nan", "inf", "-inf"]
Vector = tuple[Number, ...]
Seconds = Annotated[float, Meta(ge=0, le=LONGEST_SECONDS)]
Count = Annotated[float, Meta(ge=0, le=2**53)]
Table = dict[str, Any]


class Record(Struct):
    """All fields of a record; those of `TrialResult`, and what the file says of itself."""

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
    """What every trial has measured that has come to its end (see `outcome.make_result`); a task's own come on top."""

    mean_success: Number
    last_success: Number
    last_fitness: Number
    furthest_solved: Number
    furthest_reached: Number
    steps: Count
    environment_steps: Count


class Levels(Struct):
    """The vectors over levels of every trial that has come to its end."""

    success: Annotated[Vector, Meta(min_length=1)]
    fitness: Annotated[Vector, Meta(min_length=1)]


class Timing(Struct):
    """How long a batch of trials took."""

    run: Seconds
    compile: Seconds
    batch: Annotated[int, Meta(ge=1)]
    started: str
    ended: str = ""


class Device(Struct):
    """What a trial was computed on."""

    platform: str
    kind: str
    count: int = 1


class GitState(Struct):
    """The code's state."""

    sha: str | None = None
    dirty: bool | None = None


class Spec(Struct):
    """The parts of a specification that are read back from a record."""

    method: Table | None = None
    task: Table | None = None


class Provenance(Struct):
    """Where a trial came from; records of earlier releases say less."""

    git: GitState | None = None
    versions: dict[str, str | None] | None = None
    depends_on: list[str] | None = None
    cuda: dict[str, str] | None = None
    device: Device | None = None
    machine: str | None = None
    xla_flags: str | None = None
    matmul_precision: str | None = None
    x64: bool | None = None


class SchemaError(ValueError):
    """A record does not fit the schema; the text is a clause that says where."""


def check(plain: dict[str, Any]) -> Record:
    """Return the fields of a record with their types checked.

    Args:
        plain: the record as JSON says it, with whole numbers that a float can hold.

    Raises:
        SchemaError: naming the first field that is not as declared here.
    """
    _check_depth([plain["spec"], plain["timing"], plain["provenance"]])
    record: Record = _fitted(plain, Record, "")
    _fitted(record.spec, Spec, "spec")
    _fitted(record.timing, Timing, "timing")
    _fitted(record.provenance, Provenance, "provenance")
    if record.status in COMPLETE:
        _fitted(record.metrics, Metrics, "metrics")
        _fitted(record.levels, Levels, "levels")
    if len({len(curve) for curve in record.curves.values()}) > 1:
        raise SchemaError("its curves are not equally long")
    return record


def _fitted(value: Any, kind: Any, name: str) -> Any:
    """Return `value` as a `kind`; `name` is the field that it lies in, empty for the record itself."""
    try:
        return convert(value, kind)
    except ValidationError as error:
        problem, _, path = str(error).partition(" - at `$")
        place = f"{name}{path.rstrip('`')}".lstrip(".").replace("[...]", "")
        raise SchemaError(f"its {place or 'contents'} field is not as the schema says: {problem}") from error
    except UnicodeEncodeError as error:
        raise SchemaError(f"a name in its {name} field is no text") from error


def _check_depth(level: list[Any]) -> None:
    """Refuse values that are nested so deeply that walking through them would exhaust the interpreter's stack."""
    for _ in range(DEEPEST):
        tables = [value.values() if isinstance(value, dict) else value for value in level if type(value) in _NESTING]
        if not tables:
            return
        level = [item for table in tables for item in table]
    raise SchemaError(f"it is nested too deeply: more than {DEEPEST} levels")


_NESTING: Final = frozenset((dict, list))
