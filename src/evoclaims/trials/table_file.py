"""Tables in files of other programs, read column by column: columns that nobody asks for refuse no table."""

from __future__ import annotations

import functools
import hashlib
import struct
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from evoclaims.core.errors import UserError, guess, require_known
from evoclaims.core.files import read_file
from evoclaims.trials.table_formats import READERS, Columns, NoTableError

MOST_LISTED: Final = 30
"""Most values of a column that an error lists."""


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
    _held: dict[str, dict[tuple[type, str], tuple[Any, list[int]]]] = field(
        default_factory=dict, repr=False, compare=False
    )

    def column(self, name: str, role: str) -> Sequence[Any]:
        """Return a column; `role` says in an error what it was wanted for.

        Raises:
            UserError: when no column has this name, or two have it, or it cannot be read.
        """
        if name not in self.columns.names:
            self._require_text(self.columns.names)
        require_known(f"column in {self.name} ({role})", name, self.columns.names)
        try:
            return self.columns.cells(name)
        except NoTableError as error:
            raise UserError(f"{self.name} is not a table that can be read: {error}.") from error

    def _require_text(self, texts: Iterable[str]) -> None:
        """Check names or cells that are not as asked for: other bytes than UTF-8 may be why."""
        if any("\udc80" <= letter <= "\udcff" for text in texts for letter in text):
            raise UserError(f"{self.name} is not UTF-8 text: save it as UTF-8.")

    def rows_where(self, where: Mapping[str, object]) -> list[int]:
        """Return the rows, counted from 0, that have these values in these columns.

        Raises:
            UserError: when a column or a value in it is unknown, when cells hold a value but for how it is written, or
                no row has all.
        """
        kept = {name: self._kept(name, value) for name, value in where.items()}
        for name, (found, others) in kept.items():
            value, held = where[name], self._rows_by_cell(name)
            elsewhere = [one for other, (one, _) in kept.items() if other != name]
            others = [(cell, left) for cell, at in others if (left := sorted(set(at).intersection(*elsewhere)))]
            self._require_none_left_out(name, value, others, "but for blanks", _is_but_for_blanks)
            if not found:
                self._require_text(text for _, text in held)
                rounded = [str(cell) for cell, _ in others if _is_in_32_bits(cell, value)][:MOST_LISTED]
                known = guess(value, {text for _, text in held}) if len(held) <= MOST_LISTED else ""
                if rounded:  # closer than any that looks alike
                    known = f" In 32 bits it is equal to {', '.join(rounded)}: write one of these."
                raise UserError(f"{self.name} has no row whose {name} is {value!r}.{known}")
            self._require_none_left_out(name, value, others, "in 32 bits alone", _is_in_32_bits)
        rows = sorted(set(range(self.columns.rows)).intersection(*(found for found, _ in kept.values())))
        if not rows:
            conditions = " and ".join(f"{name} {value!r}" for name, value in where.items())
            raise UserError(f"{self.name} has no row with {conditions}." if where else f"{self.name} has no row.")
        return rows

    def _kept(self, name: str, value: object) -> tuple[set[int], list[tuple[Any, list[int]]]]:
        """Return the rows that have a value in a column, and each other cell with its rows."""
        found, others = set[int](), list[tuple[Any, list[int]]]()
        for cell, at in self._rows_by_cell(name).values():
            if _is(cell, value):
                found.update(at)
            else:
                others.append((cell, at))
        return found, others

    def _require_none_left_out(
        self,
        name: str,
        value: object,
        others: Iterable[tuple[Any, list[int]]],
        how: str,
        alike: Callable[[Any, object], bool],
    ) -> None:
        """Check that no cell of the `others` is `alike` a wanted value: a verdict on the other rows alone may differ.

        Raises:
            UserError: when one is.
        """
        near = [(cell, at) for cell, at in others if alike(cell, value)]
        if near:
            cell, at = near[0]
            raise UserError(
                f"{self.name} holds {cell!r} in row {at[0] + 1} of the column {name!r}, which is {value!r} {how}, and "
                f"where= keeps rows that have the value itself: rows like this one, {sum(len(at) for _, at in near)} "
                "in all, would be left out unseen. Write the value in one way in the whole column."
            )

    def _rows_by_cell(self, name: str) -> Mapping[tuple[type, str], tuple[Any, list[int]]]:
        """Return each different cell of a column with its rows: found once, as many conditions share a table."""
        cells = self.column(name, "a filter of where=")
        if name not in self._held:
            held: dict[tuple[type, str], tuple[Any, list[int]]] = {}
            for row, cell in enumerate(cells):
                held.setdefault((type(cell), str(cell)), (cell, []))[1].append(row)
            self._held[name] = held
        return self._held[name]

    def numbers(self, name: str, role: str, rows: Sequence[int], *, rounded: bool = False) -> list[float | None]:
        """Return the numbers of a column in some rows; None for an empty cell.

        Raises:
            UserError: when there is no such column, a cell holds something else than a number, or a whole number that
                no float holds, unless it may be `rounded`: numbers that differ would tie.
        """
        cells = self.column(name, role)
        return [self._number(name, row, cells[row], rounded) for row in rows]

    def _number(self, name: str, row: int, cell: Any, rounded: bool) -> float | None:
        if cell is None or (isinstance(cell, str) and not cell.strip()):
            return None
        try:
            if not isinstance(cell, bool) and "_" not in str(cell):  # Python alone takes 1_0 for ten
                number = float(cell)
                if not rounded and abs(number) >= 2**53 and not isinstance(cell, float) and exact(cell) != number:
                    raise UserError(
                        f"{self.name} holds {cell} in row {row + 1} of the column {name!r}, a whole number beyond 2^53 "
                        "that no float holds exactly: different values would count as equal. Subtract a constant, or "
                        "divide the column by one."
                    )
                return number
        except (TypeError, ValueError, OverflowError):
            pass
        self._require_text([str(cell)])
        raise UserError(f"{self.name} holds {cell!r} in row {row + 1} of the column {name!r}, which is not a number.")


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
        raise UserError(f"{path.name} is not a table that can be read. Its name must end in {', '.join(READERS)}.")
    data = read_file(path)
    try:
        columns = READERS[path.suffix.lower()](data)
    except NoTableError as error:
        raise UserError(f"{path.name} is not a table that can be read: {error}.") from error
    if not columns.names:
        raise UserError(f"{path.name} is a table without columns.")
    return TableFile(path.name, hashlib.sha256(data).hexdigest(), columns)


def _is(cell: Any, value: object) -> bool:
    """Whether a cell holds a value: the same text, or the same number or truth however it is written."""
    if cell == value or str(cell) == str(value):
        return True
    if isinstance(value, bool) and str(cell).lower() == str(value).lower():
        return True
    try:
        return isinstance(value, int | float) and exact(cell) == value
    except (TypeError, ValueError):
        return False


def _is_but_for_blanks(cell: Any, value: object) -> bool:
    """Whether a text holds a value once the blanks around both are gone."""
    return isinstance(cell, str) and _is(cell.strip(), value.strip() if isinstance(value, str) else value)


def _is_in_32_bits(cell: Any, value: object) -> bool:
    """Whether a cell holds a fraction as 32 bits have it: 0.10000000149 is 0.1; whole numbers are counts, and exact."""
    if not isinstance(value, float) or not 2**-126 <= abs(value) < 2**24 or value.is_integer():
        return False
    try:
        return struct.pack("f", exact(cell)) == struct.pack("f", value)
    except (TypeError, ValueError, OverflowError):  # no number, or none of 32 bits
        return False


def exact(cell: Any) -> int | float:
    """Return the number in a cell; of a whole one all digits, which a float has not."""
    try:
        return int(str(cell))
    except ValueError:  # 1e3, 7.0, True
        return float(cell)
