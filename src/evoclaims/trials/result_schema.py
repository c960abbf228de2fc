"""The schema of a trial record; every record is checked against it when it is read.

A seal shows that a record was not changed, but not that this program wrote it. The rest of the code relies on
everything that is declared here.
"""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal

from msgspec import Meta, Struct, ValidationError, convert

from evoclaims.core.errors import UserError
from evoclaims.core.printable import printable
from evoclaims.trials.result import COMPLETE, Status
from evoclaims.trials.success import SHARES, is_share

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
    machine: str | None = None
    instructions: str | None = None
    xla_flags: str | None = None
    matmul_precision: str | None = None
    x64: bool | None = None


class RecordError(UserError):
    """A text is not a valid trial record; `reason` is a clause that says why."""

    def __init__(self, reason: str) -> None:
        """Store `reason` for a caller that knows the file name."""
        self.reason = printable(reason)[:LONGEST_REASON]
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
