"""Tables as other programs export them: the columns that are asked for are read, whatever else there is."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow
import pyarrow.parquet
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoclaims.core.errors import UserError
from evoclaims.trials import table_formats
from evoclaims.trials.imported import Imported
from evoclaims.trials.table_file import read_table
from evoclaims.trials.table_formats import READERS

pytestmark = pytest.mark.oldest

FRAME = pd.DataFrame({"seed": [4, 7, 9], "return": [1.5, -2.0, 300.25], "note": ["a", "b", "c"]})
VALUES = [1.5, -2.0, 300.25]


@pytest.fixture
def values(tmp_path: Path) -> Callable[..., list[float]]:
    """A function that writes a table and returns the metric of its trials."""

    def read(text: str | bytes, name: str = "runs.csv", **settings: Any) -> list[float]:
        (tmp_path / name).write_bytes(text if isinstance(text, bytes) else text.encode())
        settings = {"seed": "seed", "metric": "return", **settings}
        return [trial.metrics["return"] for trial in Imported(name, folder=tmp_path, **settings).existing]

    return read


LAYOUTS = {
    "columns": FRAME.to_json(),
    "columns of some rows": FRAME.set_index(pd.Index([10, 3, 8])).to_json(),
    "index": FRAME.to_json(orient="index"),
    "records": FRAME.to_json(orient="records"),
    "split": FRAME.to_json(orient="split"),
    "table": FRAME.to_json(orient="table"),
    "lines": FRAME.to_json(orient="records", lines=True),
    "lists": json.dumps(FRAME.to_dict("list")),
}


@pytest.mark.parametrize("ending", ["json", "jsonl"])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_json_of_pandas_is_read_in_every_layout_with_names(
    values: Callable[..., list[float]], layout: str, ending: str
) -> None:
    assert values(LAYOUTS[layout], f"runs.{ending}") == VALUES


@pytest.mark.parametrize(
    ("ending", "text", "said"),
    [
        ("json", FRAME.to_json(orient="values"), r"row 1 is \[4,1.5,'a'\]|row 1 is \[4, 1.5, 'a'\]"),
        ("json", FRAME.set_index("note").to_json(), "which may be its columns or its rows: write it by to_json"),
        ("json", FRAME.T.to_json(orient="split").replace("7,", ""), "not all of its rows have 3 cells, as many as its"),
        ("json", '{"seed": [1, 2], "return": [3]}', r"its columns have different lengths \(1, 2\)"),
        ("json", '{"seed": {"0": 1, "0": 2}, "return": {"0": 3, "0": 4}}', "two of its rows have one label"),
        ("json", '{"seed": 1, "return": 2}\n# the end', "its line 2 is '# the end'"),
        ("json", '"runs"', "and this is 'runs'"),
        ("json", "[1, 2]", "a table in JSON is a list of objects, .*, and row 1 is 1"),
        ("json", "{", "a table in JSON is a list of objects, .*, and its line 1 is '{'"),
        ("json", '[{"seed": 1, "seed": 2, "return": 3}]', r"two of its columns have one name \(seed, return, seed"),
        ("jsonl", '{"seed": 1, "return": 3, "return": 4}', r"two of its columns have one name \(seed, return, ret"),
        ("parquet", "PAR", "it is not a Parquet file"),
        ("csv", "", "it has no first line with the columns' names"),
        ("csv", "seed,return\n1\n", r"row 1 has 1 cells \('1'\), and its first line names 2 columns \('seed,return'\)"),
        ("csv", "seed,seed\n1,2\n", r"two of its columns have one name \(seed, seed\)"),
        ("csv", FRAME.to_csv(index=False, sep=";"), "its first line has no ',' between names, but ';': 'seed"),
        ("csv", FRAME.to_csv(index=False, sep="\t"), r"its first line has no ',' between names, but .*: 'seed"),
        ("csv", 'seed,return,note\n4,1,a\n7,2,"b\n9,3,c\n', "a cell begins with a quote that does not end"),
        ("csv", FRAME.to_csv(index=False).encode("utf-16"), "it is UTF-16 text: save it as UTF-8"),
    ],
)
def test_a_file_without_names_or_with_doubt_is_refused(
    values: Callable[..., list[float]], ending: str, text: str | bytes, said: str
) -> None:
    with pytest.raises(UserError, match=rf"runs\.{ending} is not a table that can be read: .*({said})"):
        values(text, f"runs.{ending}")


@pytest.mark.parametrize("text", ["seed,r\xfcckgabe\n1,2\n", "seed,return\n1,\xfc\n"])
def test_a_table_in_latin_1_is_told_to_become_utf_8_where_its_letters_matter(
    values: Callable[..., list[float]], text: str
) -> None:
    with pytest.raises(UserError, match=r"is not UTF-8 text: save it as UTF-8"):
        values(text.encode("latin-1"), "runs.csv")


def test_a_frame_without_columns_is_a_table_without_columns(values: Callable[..., list[float]]) -> None:
    with pytest.raises(UserError, match="runs.json is a table without columns"):
        values(pd.DataFrame().to_json(orient="split"), "runs.json")


MONITOR = '#{"t_start": 1690000000.5, "env_id": "CartPole-v1"}\n'
TABLE = FRAME.to_csv(index=False)


@pytest.mark.parametrize(
    "before", [MONITOR, "# exported on Monday\n", "# lr,0.1,adam\n#\n\n# second\n", "\n\n", "\ufeff", "#a\r\n"]
)
def test_lines_before_the_names_are_passed_over(values: Callable[..., list[float]], before: str) -> None:
    assert values(before + TABLE) == VALUES
    assert values(before + TABLE.replace(",", "\t"), "runs.tsv") == VALUES


def test_names_behind_a_number_sign_are_names(values: Callable[..., list[float]]) -> None:
    file = io.StringIO()
    np.savetxt(file, FRAME[["seed", "return"]].to_numpy(), delimiter=",", header="seed,return")
    assert file.getvalue().startswith("# seed,return")
    assert values(file.getvalue(), seed="# seed") == VALUES
    with pytest.raises(UserError, match="named 'seed'. Did you mean '# seed'"):
        values(file.getvalue())


ODD = {
    "a long text": "x" * 200_000,
    "lines": 'one\n"two"\r\nthree, four',
    "an object": {"a": [1, {"b": None}]},
    "a list": [[1, 2], []],
    "a large number": 10**5000,
    "no number": math.nan,
    "nothing": None,
    "a truth": True,
}


@pytest.mark.parametrize("odd", ODD)
def test_column_that_nobody_reads_refuses_no_table(values: Callable[..., list[float]], odd: str) -> None:
    cell = json.dumps(ODD[odd]) if odd != "a large number" else "1" + "0" * 5000
    rows = [(seed, value) for seed, value in zip(FRAME["seed"], VALUES, strict=True)]
    records = [f'{{"seed": {seed}, "odd": {cell}, "odd": 1, "return": {value}}}' for seed, value in rows]
    assert values(f"[{','.join(records)}]", "runs.json") == VALUES
    assert values("\n".join(records), "runs.jsonl") == VALUES
    file = io.StringIO()
    csv.writer(file).writerows([("odd", "seed", "odd", "return"), *((cell, seed, "", value) for seed, value in rows)])
    assert values(file.getvalue()) == VALUES
    assert csv.field_size_limit() == 131_072


def test_bytes_of_another_encoding_in_a_column_that_nobody_reads_refuse_no_table(
    values: Callable[..., list[float]],
) -> None:
    assert values(TABLE.replace("b\n", "M\u00fcller\n").encode("latin-1")) == VALUES
    assert values(FRAME.replace("b", "M\u00fcller").to_json(force_ascii=False).encode("latin-1"), "runs.json") == VALUES


def test_parquet_types_that_python_has_not_are_refused_only_where_they_are_read(
    values: Callable[..., list[float]], tmp_path: Path
) -> None:
    far = pyarrow.array([2**60] * 3, pyarrow.timestamp("ms"))  # a year that Python's dates do not have
    columns = {"far": far, "seed": pyarrow.array([4, 7, 9]), "return": pyarrow.array(VALUES)}
    pyarrow.parquet.write_table(pyarrow.table(columns), tmp_path / "made.parquet")
    data = (tmp_path / "made.parquet").read_bytes()
    assert values(data, "runs.parquet") == VALUES
    with pytest.raises(UserError, match="its column 'far' cannot be read"):
        values(data, "runs.parquet", metric={"return": "far"})


@given(st.lists(st.tuples(st.text(max_size=20), st.text(max_size=20)), min_size=1, max_size=5), st.sampled_from(",\t"))
def test_every_table_that_python_writes_is_read_as_written(rows: list[tuple[str, str]], delimiter: str) -> None:
    """Or refused: only its first lines may be taken for comments."""
    rows = [(one.replace("\x00", ""), other.replace("\x00", "")) for one, other in rows]
    file = io.StringIO(newline="")
    csv.writer(file, delimiter=delimiter, quoting=csv.QUOTE_ALL).writerows([("a", "b"), *rows])
    columns = READERS[".csv" if delimiter == "," else ".tsv"](file.getvalue().encode("utf-8", "surrogatepass"))
    assert list(zip(columns.cells("a"), columns.cells("b"), strict=True)) == rows


def test_texts_that_repeat_in_parquet_are_held_once(tmp_path: Path) -> None:
    path = tmp_path / "t.parquet"
    pyarrow.parquet.write_table(pyarrow.table({"text": ["x" * 1_000] * 50_000}), path, compression="zstd")
    cells = read_table(path).columns.cells("text")
    assert len(cells) == 50_000
    assert len(set(map(id, cells))) <= 10


def test_a_parquet_file_of_too_many_rows_is_a_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table_formats, "MOST_ROWS", 10)
    pyarrow.parquet.write_table(pyarrow.table({"seed": [1] * 11}), tmp_path / "t.parquet")
    with pytest.raises(UserError, match="it has 11 rows, and at most 10 are read"):
        read_table(tmp_path / "t.parquet")


@pytest.mark.parametrize("suffix", ["csv", "jsonl", "parquet"])
@pytest.mark.parametrize("cell", [2**53 + 1, 2**64 - 1, -(2**53) - 1, 2**53, 2**60, 3])
def test_whole_numbers_that_no_float_holds_are_refused(cell: int, suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"t.{suffix}"
    if suffix == "parquet":
        kind = pyarrow.uint64() if cell > 0 else pyarrow.int64()
        pyarrow.parquet.write_table(pyarrow.table({"seed": [1], "score": pyarrow.array([cell], kind)}), path)
    else:
        path.write_text(f"seed,score\n1,{cell}\n" if suffix == "csv" else f'{{"seed": 1, "score": {cell}}}\n')
    trials = Imported(path, "seed", "score")
    if float(cell) == cell:
        assert trials.existing[0].metrics["score"] == cell
        return
    with pytest.raises(UserError, match=f"holds {cell} in row 1 of the column 'score', a whole number beyond 2.53"):
        _ = trials.existing
