"""What `evoclaims watch` keeps: `watch.toml` beside a reproduction, to which each night adds one entry.

An entry has what the night's trials measured, since the next nights rank their own trials among these. Each is sealed
with a hash of it and of the entry before: a file that was edited, torn, or merged from two is refused. The hash has no
key, so this holds against accidents, and not against someone who seals entries again.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

from msgspec import Struct, convert, to_builtins

from evoclaims.core.canonical import content_hash
from evoclaims.core.errors import UserError
from evoclaims.core.files import read_file, write_atomically

SCHEMA: Final = 1
FILE: Final = "watch.toml"

HEAD: Final = f"""\
# Written by `evoclaims watch`, which adds a [[night]] each time. Commit it, and change nothing: it would be refused.
schema = {SCHEMA}
"""

_MEND: Final = "Restore the file from version control, or remove it to begin a new watch."


class Night(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """One night.

    Attributes:
        date: ISO 8601.
        tier: whose conditions ran.
        series: number of the series of nights that are judged together, from 1 on.
        rules: hash of what must stay the same within a series.
        seeds: of the trials of each condition.
        device: kind of device that ran them.
        level: evidence that is an alarm.
        versions: of the packages that the trials depend on, by name.
        values: of each measure of each condition, in the order of seeds.
        evidence: of each family after this night.
        alarms: lines on the alarms of its series up to this night.
        restart: whether a person began the series, which ends the alarms of earlier ones.
    """

    date: str
    tier: str
    series: int
    rules: str
    seeds: tuple[int, ...]
    device: str
    level: float
    versions: dict[str, str]
    values: dict[str, dict[str, tuple[float, ...]]]
    evidence: dict[str, float]
    alarms: tuple[str, ...] = ()
    restart: bool = False


def since_restart(nights: Sequence[Night]) -> Sequence[Night]:
    """Return the nights of a tier from the last one on with which a person has begun a series."""
    return nights[max((at for at, night in enumerate(nights) if night.restart), default=0) :]


def standing(nights: Sequence[Night]) -> dict[str, tuple[str, ...]]:
    """Return the alarms of a tier's series before the last, which stay until a person begins one: a line, and details.

    Args:
        nights: of the tier, at least one.
    """
    series: dict[int, list[Night]] = {}
    for night in since_restart(nights):
        series.setdefault(night.series, []).append(night)
    del series[nights[-1].series]
    found = {}
    for number, those in series.items():
        reached = sorted({name for night in those for name, much in night.evidence.items() if much >= night.level})
        if reached:
            line = f"The alarm of series {number} ({', '.join(reached)}) stays until a night is run with --restart."
            found[line] = those[-1].alarms
    return found


def load(path: Path) -> tuple[bytes, tuple[Night, ...]]:
    """Return the bytes of a file and its nights; none of both without the file.

    Raises:
        UserError: when it cannot be read, or is not as it was written.
    """
    try:
        data = read_file(path)
        plain = tomllib.loads(data.decode())
        if plain.get("schema") != SCHEMA:
            raise ValueError(f"its schema is {plain.get('schema')!r}, and this version reads schema {SCHEMA}")
        return data, tuple(_nights(plain))
    except FileNotFoundError:
        return b"", ()
    except OSError as error:
        raise UserError(f"Cannot read {path}: {error.strerror or error}.") from error
    except (ValueError, TypeError, AttributeError, RecursionError) as error:
        raise UserError(f"{path} is not as `evoclaims watch` wrote it: {error}. {_MEND}") from error


def _nights(plain: dict[str, Any]) -> Iterator[Night]:
    if plain.keys() != {"schema", "night"}:
        raise ValueError("it has other entries than nights")
    seal = ""
    for number, entry in enumerate(plain["night"], start=1):
        stored = entry.pop("seal", None)
        night = convert(entry, Night)
        seal = _seal(seal, night)
        if stored != seal:
            raise ValueError(f"night {number} does not match its seal, so it was edited, torn or moved")
        yield night


def append(path: Path, before: bytes, night: Night) -> None:
    """Add a night to a file whose bytes were `before` when its nights were read.

    Raises:
        UserError: when the file has changed since.
        StorageError: when it cannot be written.
    """
    now, nights = load(path)
    if now != before:
        raise UserError(f"{path} has changed during this night, which is not added. Run the same command again.")
    added = convert(to_builtins(night), Night)  # a whole number may stand where a float is declared
    seal = ""
    for one in (*nights, added):
        seal = _seal(seal, one)
    write_atomically(path, (before or HEAD.encode()) + _text({**to_builtins(added), "seal": seal}).encode())


def _seal(before: str, night: Night) -> str:
    return content_hash([before, to_builtins(night)])


def _text(entry: dict[str, Any]) -> str:
    """Return an entry as TOML, a measure on a line."""
    tables = {name: table for name, table in entry.items() if isinstance(table, dict)}
    lines = ["", "[[night]]", *_lines({name: value for name, value in entry.items() if name not in tables})]
    values = tables.pop("values")
    for name, table in {**tables, **{f"values.{_plain(one)}": rows for one, rows in values.items()}}.items():
        lines += ["", f"[night.{name}]", *_lines(table)]
    return "\n".join(lines) + "\n"


def _lines(table: dict[str, Any]) -> list[str]:
    return [f"{_plain(name)} = {_plain(value)}" for name, value in table.items()]


def _plain(value: Any) -> str:
    """Return a text, number, truth value or list as TOML writes it."""
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_plain, value))}]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str | bool) else repr(value)
