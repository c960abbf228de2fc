"""What is larger than can be held or counted ends as a sentence, before it has cost anything."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from trial_toys import walk

from evoclaims.core.errors import UserError
from evoclaims.trials import table_file, table_formats
from evoclaims.trials.imported import Imported
from evoclaims.trials.spec import Budget
from evoclaims.trials.table_file import read_table
from evoclaims.trials.table_formats import READERS

pytestmark = pytest.mark.oldest

pyarrow = pytest.importorskip("pyarrow")
parquet = pytest.importorskip("pyarrow.parquet")


@pytest.mark.parametrize("steps", [2**31, 2**40, 2**60])
def test_a_budget_that_no_counter_holds_is_a_sentence(steps: int) -> None:
    with pytest.raises(UserError, match=f"has a budget of {steps} steps, and a trial takes at most 2147483647"):
        _ = walk(steps=steps).steps
    assert walk(steps=2**31 - 1).steps == 2**31 - 1


def test_environment_steps_that_no_float_counts_are_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    condition = walk(steps=4)
    monkeypatch.setattr(type(condition.method), "cost", lambda self, task: 2**52)
    with pytest.raises(UserError, match=r"18014398509481984 environment steps \(4 steps of 4503599627370496\)"):
        _ = condition.environment_steps
    assert Budget(generations=2).steps(2**52) * 2**52 == 2**53


def _parquet(path: Path, **columns: list[object]) -> Path:
    parquet.write_table(pyarrow.table(columns), path, compression="zstd")
    return path


def test_only_named_columns_of_parquet_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[str] = []
    batches = parquet.ParquetFile.iter_batches

    def noted(self: Any, *, columns: list[str], **options: Any) -> Any:
        read.extend(columns)
        return batches(self, columns=columns, **options)

    monkeypatch.setattr(parquet.ParquetFile, "iter_batches", noted)
    path = _parquet(tmp_path / "t.parquet", seed=[1, 2], algo=["a", None], score=[1.5, None], huge=["x" * 100] * 2)
    trials = Imported(path, "seed", "score", where={"algo": "a"})
    assert [trial.metrics for trial in trials.existing] == [{"score": 1.5}]
    assert sorted(set(read)) == ["algo", "score", "seed"]
    assert len(read) == 3
    everything = READERS[".parquet"](path.read_bytes())
    cells = {name: everything.cells(name) for name in everything.names}
    assert cells == {"seed": [1, 2], "algo": ["a", None], "score": [1.5, None], "huge": ["x" * 100] * 2}


def test_texts_that_repeat_in_parquet_are_held_once(tmp_path: Path) -> None:
    path = _parquet(tmp_path / "t.parquet", text=["x" * 1_000] * 50_000)
    cells = read_table(path).columns.cells("text")
    assert len(cells) == 50_000
    assert len(set(map(id, cells))) <= 10


def test_a_parquet_file_of_too_many_rows_is_a_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table_formats, "MOST_ROWS", 10)
    with pytest.raises(UserError, match="it has 11 rows, and at most 10 are read"):
        read_table(_parquet(tmp_path / "t.parquet", seed=[1] * 11))


@pytest.mark.parametrize("suffix", ["csv", "jsonl", "parquet"])
@pytest.mark.parametrize("cell", [2**53 + 1, 2**64 - 1, -(2**53) - 1, 2**53, 2**60, 3])
def test_whole_numbers_that_no_float_holds_are_refused(cell: int, suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"t.{suffix}"
    if suffix == "parquet":
        kind = pyarrow.uint64() if cell > 0 else pyarrow.int64()
        parquet.write_table(pyarrow.table({"seed": [1], "score": pyarrow.array([cell], kind)}), path)
    else:
        path.write_text(f"seed,score\n1,{cell}\n" if suffix == "csv" else f'{{"seed": 1, "score": {cell}}}\n')
    trials = Imported(path, "seed", "score")
    if float(cell) == cell:
        assert trials.existing[0].metrics["score"] == cell
        return
    with pytest.raises(UserError, match=f"holds {cell} in row 1 of the column 'score', a whole number beyond 2.53"):
        _ = trials.existing


def test_a_filter_looks_at_each_different_cell_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "t.csv"
    path.write_text("seed,algo,score\n" + "".join(f"{row},a{row % 5},{row}\n" for row in range(1000)))
    compared: list[object] = []
    same = table_file._is
    monkeypatch.setattr(table_file, "_is", lambda cell, value: compared.append(cell) or same(cell, value))
    for algo in range(5):
        rows = [
            int(trial.metrics["score"])
            for trial in Imported(path, "seed", "score", where={"algo": f"a{algo}"}).existing
        ]
        assert rows == list(range(algo, 1000, 5))
    assert len(compared) == 25
