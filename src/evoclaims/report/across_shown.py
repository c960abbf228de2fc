"""What `evoclaims across` has found, kept in its store for the report."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import msgspec

from evoclaims.core.errors import UserError
from evoclaims.core.files import read_file, write_atomically
from evoclaims.report import across_table
from evoclaims.report.charts_of_verdicts import across_chart
from evoclaims.report.verdict_chart import VerdictChart
from evoclaims.verdicts.across import Across

FILE: Final = "across.json"


@dataclass(frozen=True)
class AcrossShown:
    """What a report shows of claims in several environments.

    Attributes:
        made: when (ISO 8601).
        command: that made it.
        headline: what changed against the first environment, in a sentence.
        lines: what the chart has no room for.
        chart: verdicts by environment.
    """

    made: str
    command: str
    headline: str
    lines: tuple[str, ...]
    chart: VerdictChart


def keep(found: Across, store: Path, made: str, command: str) -> None:
    """Write what was found into the folder of a store, in place of what was found before."""
    shown = AcrossShown(made, command, across_table.headline(found), tuple(found.lines), across_chart(found))
    write_atomically(store / FILE, msgspec.json.encode(shown))


def last(stores: Iterable[Path]) -> AcrossShown | None:
    """Return what was found last, of all that is kept in the folders of some stores.

    Raises:
        UserError: when a file cannot be read or holds something else.
    """
    return max((one for store in stores if (one := _read(store / FILE))), key=lambda one: one.made, default=None)


def _read(path: Path) -> AcrossShown | None:
    """Return what is kept in a file; None without the file."""
    try:
        return msgspec.json.decode(read_file(path), type=AcrossShown)
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (OSError, ValueError, RecursionError) as error:
        raise UserError(f"{path} is not a file of `evoclaims across` ({error}). Delete it.") from error
