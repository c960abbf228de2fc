"""Trials and verdicts as flat tables, for analysis with pandas.

They are not written by pandas, which turns None (not measured) into NaN (measured as NaN).
"""

from __future__ import annotations

import csv
import importlib
import io
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Final

from evoclaims.core.canonical import as_plain
from evoclaims.core.errors import UserError
from evoclaims.core.printable import printable
from evoclaims.paper.archive import Name
from evoclaims.trials.result import TrialResult
from evoclaims.verdicts.claim_report import ClaimReport

SCHEMA: Final = 1
"""Version of the JSON form; raised when a column changes its meaning."""

Row = Mapping[str, Any]
"""One row of a table: values by column. For a missing value, the column holds None or is absent."""

_FORMULA: Final = ("=", "+", "-", "@")
"""First characters of texts that spreadsheets evaluate (a leading tab or carriage return is already escaped)."""


def trial_rows(trials: Iterable[TrialResult], names: Mapping[str, Sequence[Name]]) -> list[Row]:
    """Return one row per trial.

    Columns: "id", "condition", "tier", "variant", "method", "task" (as the reproduction names them; several names are
    joined by commas; for a condition that it does not have, tier and variant are None, method and task the record's
    own), "seed", "status", "digest", then "metrics.…" (numbers), "levels.…" (one number per level), "timing.…" and
    "provenance.…" ("provenance.versions.jax", …). Training curves are only in the records themselves.
    """
    return [_trial_row(trial, names.get(trial.condition, ())) for trial in trials]


def verdict_rows(reports: Iterable[ClaimReport]) -> list[Row]:
    """Return one row per claim and tier: what was judged, how it ended, and the numbers of the whole assertion."""
    return [
        {
            "claim": report.claim,
            "case": report.case,
            "tier": report.tier,
            "outcome": report.outcome,
            "reason": report.reason,
            "n": report.n,
            **{
                name: getattr(report.verdict, name, None)
                for name in (
                    *("p", "attainable_p", "p_refuted", "attainable_p_refuted"),
                    *("p_smaller", "attainable_p_smaller", "alpha", "fingerprint"),
                )
            },
            "expected": report.expected,
            "because": report.because,
            "faults": report.tried,
            "statement": report.statement,
            "where": report.where,
        }
        for report in reports
    ]


def as_json(rows: Sequence[Row]) -> bytes:
    """Return {"schema": 1, "rows": […]} as strict JSON: NaN and the infinities are the texts "nan", "inf", "-inf"."""
    plain = as_plain({"schema": SCHEMA, "rows": [dict(row) for row in rows]})
    return (json.dumps(plain, indent=1, allow_nan=False) + "\n").encode("ascii")


def as_csv(rows: Sequence[Row]) -> bytes:
    """Return comma-separated values: empty for None, "nan" for NaN, JSON for lists.

    In texts and headings, control characters are escaped, and an apostrophe precedes what a spreadsheet would take
    for a formula; numbers are unchanged.
    """
    text = io.StringIO(newline="")
    columns = columns_of(rows)
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([_cell(name) for name in columns])
    writer.writerows([_cell(row.get(name)) for name in columns] for row in rows)
    return text.getvalue().encode()


def as_parquet(rows: Sequence[Row]) -> bytes:
    """Return an Apache Parquet file: null for None, which is not NaN.

    Raises:
        UserError: when pyarrow is not installed.
    """
    try:
        arrow: Any = importlib.import_module("pyarrow")
        parquet: Any = importlib.import_module("pyarrow.parquet")
    except ImportError as error:
        raise UserError(
            "Parquet files are written by pyarrow, which is not installed: pip install evoclaims[parquet], or take "
            "--as json or csv."
        ) from error
    file = io.BytesIO()
    columns = {name: [row.get(name) for row in rows] for name in columns_of(rows)}
    parquet.write_table(arrow.table({name: _column(arrow, values) for name, values in columns.items()}), file)
    return file.getvalue()


FORMS: Final[Mapping[str, Callable[[Sequence[Row]], bytes]]] = {
    "json": as_json,
    "csv": as_csv,
    "parquet": as_parquet,
}
"""Writers by the names of their forms."""


def columns_of(rows: Sequence[Row]) -> list[str]:
    """Return the columns of all rows; grouped by the part before the dot, in the order of first appearance."""
    names = dict.fromkeys(name for row in rows for name in row)
    groups = list(dict.fromkeys(name.partition(".")[0] for name in names))
    return sorted(names, key=lambda name: groups.index(name.partition(".")[0]))


def _trial_row(trial: TrialResult, names: Sequence[Name]) -> Row:
    of = trial.spec
    return {
        "id": trial.id,
        "condition": trial.condition,
        "tier": _joined(name.tier for name in names),
        "variant": _joined(name.variant for name in names),
        "method": _joined(name.method for name in names) or (of.get("method") or {}).get("name"),
        "task": _joined(name.task for name in names) or (of.get("task") or {}).get("name"),
        "seed": trial.seed,
        "status": trial.status,
        "digest": trial.digest,
        **{f"metrics.{name}": value for name, value in trial.metrics.items()},
        **{f"levels.{name}": list(values) for name, values in trial.levels.items()},
        **_flat("timing", trial.timing),
        **_flat("provenance", trial.provenance),
    }


def _joined(values: Iterable[str]) -> str | None:
    """Return the different texts as one; None if there are none."""
    different = list(dict.fromkeys(values))
    return ", ".join(different) if different else None


def _flat(name: str, value: Any) -> dict[str, Any]:
    """Return nested mappings as columns with dotted names."""
    if not isinstance(value, Mapping):
        return {name: value}
    return {column: leaf for key, part in value.items() for column, leaf in _flat(f"{name}.{key}", part).items()}


def _cell(value: Any) -> Any:
    if isinstance(value, list | tuple | dict):
        return json.dumps(as_plain(value))
    if not isinstance(value, str):
        return value
    text = printable(value)
    return f"'{text}" if text.startswith(_FORMULA) else text


def _column(arrow: Any, values: Sequence[Any]) -> Any:
    """Return a column of numbers, of lists of numbers, or else of texts, whose stray surrogates are escaped."""
    try:
        column = arrow.array(values)
    except (arrow.ArrowException, OverflowError, UnicodeError):
        column = None
    if column is not None and not arrow.types.is_nested(getattr(column.type, "value_type", column.type)):
        return column
    texts = (x if isinstance(x, str) or x is None else json.dumps(as_plain(x)) for x in values)
    return arrow.array([x if x is None else x.encode("utf-8", "backslashreplace").decode() for x in texts])
