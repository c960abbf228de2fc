"""Tables in files of other programs, read column by column: CSV, JSON and Parquet."""

from __future__ import annotations

import csv
import functools
import hashlib
import importlib
import io
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from evoclaims.core.errors import UserError, guess, require_known
from evoclaims.core.files import read_file

Columns = Mapping[str, Sequence[Any]]
"""Equally long columns by name; cells are texts (CSV) or what the format has: None, numbers, texts."""

MOST_LISTED: Final = 30
"""Most values of a column that an error lists."""


class NoTableError(Exception):
    """The content of a file is no table; the text is a clause that says why."""


@dataclass(frozen=True)
class TableFile:
    """A table that has been read.

    Attributes:
        name: of its file.
        sha256: of the file, 64 hexadecimal digits.
        columns: what it holds.
    """

    name: str
    sha256: str
    columns: Columns

    def column(self, name: str, role: str) -> Sequence[Any]:
        """Return a column; `role` says in an error what it was wanted for.

        Raises:
            UnknownNameError: for an unknown name.
        """
        require_known(f"column in {self.name} ({role})", name, self.columns)
        return self.columns[name]

    def rows_where(self, where: Mapping[str, object]) -> list[int]:
        """Return the rows, counted from 0, that have these values in these columns.

        Raises:
            UserError: when a column or a value in it is unknown, or no row has all.
        """
        rows = list(range(len(next(iter(self.columns.values())))))
        for name, value in where.items():
            cells = self.column(name, "a filter of where=")
            if not any(_is(cell, value) for cell in cells):
                held = {str(cell) for cell in cells}
                known = guess(value, held) if len(held) <= MOST_LISTED else ""
                raise UserError(f"{self.name} has no row whose {name} is {value!r}.{known}")
            rows = [row for row in rows if _is(cells[row], value)]
        if not rows:
            conditions = " and ".join(f"{name} {value!r}" for name, value in where.items())
            raise UserError(f"{self.name} has no row with {conditions}." if where else f"{self.name} has no row.")
        return rows

    def numbers(self, name: str, role: str, rows: Sequence[int]) -> list[float | None]:
        """Return the numbers of a column in some rows; None for an empty cell.

        Raises:
            UserError: when there is no such column, or a cell holds something else than a number.
        """
        cells = self.column(name, role)
        return [self._number(name, row, cells[row]) for row in rows]

    def _number(self, name: str, row: int, cell: Any) -> float | None:
        """Return the number in a cell."""
        if cell is None or (isinstance(cell, str) and not cell.strip()):
            return None
        try:
            if not isinstance(cell, bool) and "_" not in str(cell):  # Python alone takes 1_0 for ten
                return float(cell)
        except (TypeError, ValueError, OverflowError):
            pass
        raise UserError(f"{self.name} holds {cell!r} in row {row + 1} of the column {name!r}, which is no number.")


def read_table(path: Path) -> TableFile:
    """Read a table, or return it as it was read earlier if the file is unchanged.

    Raises:
        UserError: when the file cannot be read, is of another kind, or holds no table.
    """
    try:
        at = path.stat()
        return _read(path, at.st_mtime_ns, at.st_size)
    except OSError as error:
        raise UserError(f"The table {path} cannot be read: {error.strerror or error}.") from error


@functools.lru_cache(maxsize=8)  # conditions share tables
def _read(path: Path, modified: int, size: int) -> TableFile:
    """Read a table; `modified` and `size` tell its versions apart."""
    if path.suffix.lower() not in READERS:
        raise UserError(f"{path.name} is no table that can be read: the name of one ends in {', '.join(READERS)}.")
    data = read_file(path)
    try:
        columns = READERS[path.suffix.lower()](data)
    except NoTableError as error:
        raise UserError(f"{path.name} is no table that can be read: {error}.") from error
    if not columns:
        raise UserError(f"{path.name} is a table without columns.")
    return TableFile(path.name, hashlib.sha256(data).hexdigest(), columns)


def _is(cell: Any, value: object) -> bool:
    """Whether a cell holds a value: the same text, or the same number or truth however it is written."""
    if cell == value or str(cell) == str(value):
        return True
    if isinstance(value, bool) and str(cell).lower() == str(value).lower():
        return True
    try:
        return isinstance(value, int | float) and float(cell) == value
    except (TypeError, ValueError):
        return False


def _text(data: bytes) -> str:
    """Return the text of a file."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise NoTableError("it is no UTF-8 text") from error


def _csv(data: bytes, delimiter: str = ",") -> Columns:
    """Read comma-separated values, whose first line names the columns."""
    try:
        head, *rows = [row for row in csv.reader(io.StringIO(_text(data), newline=""), delimiter=delimiter) if row]
    except csv.Error as error:
        raise NoTableError(str(error)) from error
    except ValueError as error:
        raise NoTableError("it has no first line with the columns' names") from error
    _unlike(head)
    for number, row in enumerate(rows, start=1):
        if len(row) != len(head):
            raise NoTableError(f"row {number} has {len(row)} cells, and its first line names {len(head)} columns")
    return {name: [row[place] for row in rows] for place, name in enumerate(head)}


def _json(data: bytes) -> Columns:
    """Read a list of objects, or one object a line."""
    text = _text(data)
    try:
        try:
            rows = json.loads(text, object_pairs_hook=_object)
        except ValueError:
            lines = text.split("\n")  # a text may hold other separators of lines
            rows = [json.loads(line, object_pairs_hook=_object) for line in lines if line.strip()]
    except (ValueError, RecursionError):
        rows = None
    rows = [rows] if isinstance(rows, dict) else rows  # a file of one line
    if not isinstance(rows, list) or not rows or not all(isinstance(row, dict) for row in rows):
        raise NoTableError("it is neither a JSON list of objects nor one object a line, each a row")
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: [row.get(name) for row in rows] for name in names}


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return a JSON object."""
    _unlike([name for name, _ in pairs])
    return dict(pairs)


def _unlike(names: Sequence[str]) -> None:
    """Reject columns of one name, of which a reader would see one."""
    if len(set(names)) < len(names):
        raise NoTableError(f"two of its columns have one name ({', '.join(names)})")


def _parquet(data: bytes) -> Columns:
    """Read an Apache Parquet file; a null stays None, which is not NaN."""
    try:
        arrow: Any = importlib.import_module("pyarrow")
        parquet: Any = importlib.import_module("pyarrow.parquet")
    except ImportError as error:
        raise NoTableError("pyarrow, which reads Parquet, is not installed: pip install evoclaims[parquet]") from error
    try:
        file = parquet.ParquetFile(io.BytesIO(data))
        _unlike(file.schema_arrow.names)
        columns: Columns = file.read().to_pydict()
    except (arrow.ArrowException, OSError) as error:
        raise NoTableError("it is no Parquet file") from error
    return columns


READERS: Final[Mapping[str, Callable[[bytes], Columns]]] = {
    ".csv": _csv,
    ".tsv": functools.partial(_csv, delimiter="\t"),
    ".json": _json,
    ".jsonl": _json,
    ".parquet": _parquet,
}
"""Readers by the ends of files' names."""
