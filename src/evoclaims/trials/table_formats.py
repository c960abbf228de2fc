"""Readers of tables: CSV, JSON in the layouts that pandas writes, and Parquet.

A column that nobody asks for is not looked at: its name may be there twice, its cells may be long, or of any type.
"""

from __future__ import annotations

import csv
import functools
import importlib
import io
import json
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final

MOST_ROWS: Final = 5_000_000
"""Of a Parquet file, which may hold any number of equal rows in a few bytes."""
ENCODINGS: Final = {b"\xff\xfe": "UTF-16", b"\xfe\xff": "UTF-16"}
"""Encodings other than UTF-8 by a file's first bytes."""


class NoTableError(Exception):
    """The content of a file is no table; the text is a clause that says why."""


@dataclass(frozen=True)
class Columns:
    """The columns of a table.

    Attributes:
        names: of all columns, in their order; a name may be there twice.
        rows: how many cells each column has.
        read: returns the cells of the column at a place: texts (CSV) or what the format has (None, numbers, texts).
    """

    names: Sequence[str]
    rows: int
    read: Callable[[int], Sequence[Any]]

    def cells(self, name: str) -> Sequence[Any]:
        """Return the cells of a column.

        Raises:
            NoTableError: when two columns have this name, or it cannot be read.
        """
        if self.names.count(name) > 1:
            raise NoTableError(f"two of its columns have one name ({', '.join(self.names)})")
        return self.read(self.names.index(name))


def _text(data: bytes) -> str:
    """Return the text of a file; bytes that are not UTF-8, as in a column of names, stay apart from all text."""
    encoding = ENCODINGS.get(data[:2])
    if encoding:
        raise NoTableError(f"it is {encoding} text: save it as UTF-8")
    return data.decode("utf-8-sig", "surrogateescape")


@contextmanager
def _long_cells() -> Iterator[None]:
    """Let Python's reader of CSV take cells of any length."""
    before = csv.field_size_limit(min(sys.maxsize, 2**31 - 1))
    try:
        yield
    finally:
        csv.field_size_limit(before)


def _csv(data: bytes, delimiter: str = ",") -> Columns:
    """Read comma-separated values, whose first line names the columns; comments, lines with #, may precede it."""
    lines, end = _without_comments(_text(data), delimiter), "\0"
    try:
        with _long_cells():
            reader = csv.reader(io.StringIO(f"{lines}\n{end}", newline=""), delimiter=delimiter)
            *table, last = [row for row in reader if row]
    except csv.Error as error:
        raise NoTableError(str(error)) from error
    if last != [end]:
        raise NoTableError("a cell begins with a quote that does not end")
    if not table:
        raise NoTableError("it has no first line with the columns' names")
    head, *rows = table
    others = [other for other in ";\t|" if other in head[0]]
    if len(head) == 1 and others:
        raise NoTableError(
            f"its first line has no {delimiter!r} between names, but {others[0]!r}: {lines.splitlines()[0][:80]!r}"
        )
    for number, row in enumerate(rows, start=1):
        if len(row) != len(head):
            raise NoTableError(
                f"row {number} has {len(row)} cells ({delimiter.join(row)[:80]!r}), and its first line names "
                f"{len(head)} columns ({delimiter.join(head)[:80]!r})"
            )
    return Columns(head, len(rows), lambda place: [row[place] for row in rows])


def _without_comments(text: str, delimiter: str) -> str:
    """Return a text without the comments before its first line, such as the #{...} of a monitor file.

    A line with # stays if it names the columns, as NumPy's `savetxt` writes them: numbers follow it, as many as names.
    """
    rest, comment = text, ""
    while rest.lstrip("\r\n").startswith("#"):
        comment, _, rest = rest.lstrip("\r\n").partition("\n")
    following = rest.lstrip("\r\n").partition("\n")[0].split(delimiter)
    if comment and len(following) == len(comment.split(delimiter)) and any(map(_is_number, following)):
        return f"{comment}\n{rest}"
    return rest


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _json(data: bytes) -> Columns:
    """Read JSON: a list of objects, one object a line, or a layout of `DataFrame.to_json` with the columns' names."""
    text = _text(data)
    try:
        plain = _loaded(text)
    except (ValueError, RecursionError):
        plain = [_row(number, line) for number, line in enumerate(text.split("\n"), start=1) if line.strip()]
    if isinstance(plain, _Pairs):
        return _of_object(plain)
    if not isinstance(plain, list) or not plain:
        raise NoTableError(f"{_HOW_JSON}, and this is {_shown(plain)}")
    for number, row in enumerate(plain, start=1):
        if not isinstance(row, _Pairs):
            raise NoTableError(f"{_HOW_JSON}, and row {number} is {_shown(row)}")
    return _of_rows(plain)


_HOW_JSON: Final = (
    "a table in JSON is a list of objects, one object a line, or what DataFrame.to_json() writes with the columns' "
    "names"
)


class _Pairs(list[tuple[str, Any]]):
    """A JSON object, in which a name may be there twice."""


def _loaded(text: str) -> Any:
    """Return JSON, with objects as `_Pairs`; a number with too many digits for Python stays a text."""
    return json.loads(text, object_pairs_hook=_Pairs, parse_int=lambda digits: _whole(digits))


def _whole(digits: str) -> int | str:
    """Return a whole number, or its text where Python takes it for too long."""
    try:
        return int(digits)
    except ValueError:
        return digits


def _row(number: int, line: str) -> Any:
    try:
        return _loaded(line)
    except (ValueError, RecursionError) as error:
        raise NoTableError(f"{_HOW_JSON}, and its line {number} is {_shown(line)}") from error


def _of_rows(rows: Sequence[_Pairs]) -> Columns:
    """Return the columns of objects; a name that one object has twice is there twice."""
    tables = [dict(row) for row in rows]
    names = list(dict.fromkeys(name for table in tables for name in table))
    for row, table in zip(rows, tables, strict=True):
        if len(row) > len(table):
            names += {name for name, _ in row if sum(name == other for other, _ in row) > names.count(name)}
    return Columns(names, len(rows), lambda place: [table.get(names[place]) for table in tables])


def _of_object(whole: _Pairs) -> Columns:
    """Return the columns of one object: of columns, of rows, of both apart, or a row.

    Columns and rows are distinguished by the labels of rows, which pandas counts.
    """
    table, values = dict(whole), [value for _, value in whole]
    rows = table.get("data")
    if isinstance(rows, list) and isinstance(table.get("columns"), list):  # orient="split"
        names = [str(name) for name in table["columns"]]
        if not all(isinstance(row, list) and len(row) == len(names) for row in rows):
            raise NoTableError(f"not all of its rows have {len(names)} cells, as many as its columns")
        return _of_lists(_Pairs((name, [row[place] for row in rows]) for place, name in enumerate(names)))
    if isinstance(rows, list) and "schema" in table and all(isinstance(row, _Pairs) for row in rows):  # orient="table"
        return _of_rows(rows)
    if values and all(isinstance(value, _Pairs) for value in values):
        outer, inner = (_are_counted(names) for names in (table, {name for value in values for name, _ in value}))
        if inner and not outer:
            columns = {name: dict(cells) for name, cells in whole}
            if any(len(dict(cells)) < len(cells) for cells in values):
                raise NoTableError("two of its rows have one label, and only one of them would be read")
            labels = dict.fromkeys(label for cells in columns.values() for label in cells)
            return _of_lists(_Pairs((name, [dict(cells).get(label) for label in labels]) for name, cells in whole))
        if outer and not inner:
            return _of_rows(values)
        raise NoTableError(
            "it is an object of objects, which may be its columns or its rows: write it by to_json(orient='records')"
        )
    if values and all(isinstance(value, list) and not isinstance(value, _Pairs) for value in values):
        return _of_lists(whole)
    return _of_rows([whole])


def _of_lists(columns: _Pairs) -> Columns:
    lengths = {len(cells) for _, cells in columns}
    if len(lengths) > 1:
        raise NoTableError(f"its columns have different lengths ({', '.join(map(str, sorted(lengths)))})")
    return Columns([name for name, _ in columns], max(lengths, default=0), lambda place: columns[place][1])


def _are_counted(names: Iterable[str]) -> bool:
    """Whether names are whole numbers, as pandas labels rows."""
    return all(name.removeprefix("-").isdecimal() for name in names)


def _shown(value: Any) -> str:
    return repr(value)[:80]


def _parquet(data: bytes) -> Columns:
    """Read an Apache Parquet file; a null stays None, which is not NaN."""
    try:
        arrow: Any = importlib.import_module("pyarrow")
        parquet: Any = importlib.import_module("pyarrow.parquet")
    except ImportError as error:
        raise NoTableError("pyarrow, which reads Parquet, is not installed: pip install evoclaims[parquet]") from error
    try:
        file = parquet.ParquetFile(io.BytesIO(data))
        schema, rows = file.schema_arrow, file.metadata.num_rows
    except (arrow.ArrowException, OSError) as error:
        raise NoTableError("it is not a Parquet file") from error
    if rows > MOST_ROWS:
        raise NoTableError(f"it has {rows:,} rows, and at most {MOST_ROWS:,} are read: keep those of the claims")

    @functools.cache
    def cells(place: int) -> Sequence[Any]:
        """Read a column in batches when it is asked for: a few bytes may hold gigabytes."""
        name = schema.names[place]
        kind = schema.field(place).type
        texts = arrow.types.is_string(kind) or arrow.types.is_large_string(kind)
        read: list[Any] = []
        try:
            # Texts that repeat stay one text each.
            file = parquet.ParquetFile(io.BytesIO(data), read_dictionary=[name] if texts else [])
            for batch in file.iter_batches(columns=[name], batch_size=2**16):
                column = batch.column(0)
                if arrow.types.is_dictionary(column.type):
                    held = column.dictionary.to_pylist()
                    read += [None if at is None else held[at] for at in column.indices.to_pylist()]
                else:
                    read += column.to_pylist()
        except (arrow.ArrowException, ValueError, OverflowError, ImportError, OSError) as error:
            raise NoTableError(f"its column {name!r} cannot be read ({error})") from error
        return read

    return Columns(schema.names, rows, cells)


READERS: Final[Mapping[str, Callable[[bytes], Columns]]] = {
    ".csv": _csv,
    ".tsv": functools.partial(_csv, delimiter="\t"),
    ".json": _json,
    ".jsonl": _json,
    ".parquet": _parquet,
}
"""Readers by the ends of files' names."""
