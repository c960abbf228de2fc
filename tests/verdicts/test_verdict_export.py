"""Trials and verdicts as tables: every number comes back, and what is no number stays visible."""

from __future__ import annotations

import csv
import io
import json
import math
import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pandas
import pandas.core.arrays.arrow.extension_types  # registers types, once: pytester forgets what tests import
import pyarrow.parquet
import pytest
from hand_made_verdicts import report, verdict
from hypothesis import example, given
from hypothesis import strategies as st

from evoclaims.core.errors import UserError
from evoclaims.core.printable import printable
from evoclaims.paper.archive import Name, names_of
from evoclaims.paper.reproduction import Reproduction, Tier, Variant
from evoclaims.trials.result import TrialResult
from evoclaims.verdicts.export import FORMS, as_csv, as_json, as_parquet, columns_of, trial_rows, verdict_rows

NAMES = (Name("smoke", "", "better", "small"),)


@pytest.fixture
def trial(made: Any, reproduction: Reproduction) -> Callable[..., TrialResult]:
    """A function that makes a trial with other metrics."""

    def make(seed: int = 0, metrics: dict[str, float] | None = None, **provenance: Any) -> TrialResult:
        result: TrialResult = made(reproduction.tier("smoke").condition("better", "small"), seed, 1.0, **provenance)
        return replace(result, metrics={**result.metrics, **(metrics or {})})

    return make


def test_a_trial_is_a_row_with_its_names_metrics_and_origin(trial: Any) -> None:
    made = trial(3, versions={"jax": "0.10.2"}, device={"kind": "cpu"})
    (row,) = trial_rows([made], {made.condition: NAMES})
    assert (row["tier"], row["variant"], row["method"], row["task"]) == ("smoke", "", "better", "small")
    assert (row["id"], row["seed"], row["status"], row["digest"]) == (made.id, 3, "done", made.digest)
    assert row["metrics.environment_steps"] == 103.0
    assert row["levels.success"] == [1.0] * len(made.levels["success"])
    assert row["timing.batch"] == 1
    assert (row["provenance.versions.jax"], row["provenance.device.kind"]) == ("0.10.2", "cpu")


def test_a_trial_of_an_unknown_condition_keeps_the_names_in_its_record(trial: Any) -> None:
    (row,) = trial_rows([trial()], {})
    assert (row["tier"], row["variant"], row["method"], row["task"]) == (None, None, "hand_built", "n_parity")


def test_a_condition_with_several_names_is_one_row_with_all_of_them(trial: Any) -> None:
    made = trial()
    (row,) = trial_rows([made], {made.condition: (*NAMES, Name("full", "", "better", "small"))})
    assert (row["tier"], row["method"]) == ("smoke, full", "better")


def test_names_are_those_of_the_protocol_and_else_of_a_variant(reproduction: Reproduction) -> None:
    design, conditions = reproduction.tiers["smoke"].design, dict(reproduction.tiers["smoke"].conditions)
    removed = conditions.pop(("worse", "large"))
    swapped = {("better", "small"): conditions["worse", "small"], ("better", "large"): removed}
    names = names_of(
        replace(
            reproduction,
            tiers={
                "smoke": Tier(conditions, design),
                "full": Tier({("a", "b"): conditions["better", "small"]}, design),
            },
            variants={"v": Variant("swapped", {"smoke": swapped})},
        )
    )
    assert names[conditions["worse", "small"].id] == (Name("smoke", "", "worse", "small"),)
    assert names[removed.id] == (Name("smoke", "v", "better", "large"),)
    assert names[conditions["better", "small"].id] == (Name("smoke", "", "better", "small"), Name("full", "", "a", "b"))


def test_json_is_strict_and_says_its_schema_and_what_is_no_number(trial: Any) -> None:
    odd = {"mean_success": math.nan, "reward": -math.inf}
    plain = json.loads(as_json(trial_rows([trial(0, odd)], {})), parse_constant=pytest.fail)
    assert plain["schema"] == 1
    assert (plain["rows"][0]["metrics.mean_success"], plain["rows"][0]["metrics.reward"]) == ("nan", "-inf")


def test_csv_tells_nan_from_nothing_and_reads_back_into_pandas(trial: Any) -> None:
    rows = trial_rows([trial(0, {"mean_success": math.nan}), trial(1, {"extra": 0.25})], {})
    text = as_csv(rows).decode()
    first, second = csv.DictReader(io.StringIO(text))
    assert (first["metrics.mean_success"], first["metrics.extra"], second["metrics.extra"]) == ("nan", "", "0.25")
    assert json.loads(first["levels.success"]) == rows[0]["levels.success"]
    table = pandas.read_csv(io.BytesIO(as_csv(rows)))
    assert table["metrics.environment_steps"].tolist() == [100.0, 101.0]


def test_parquet_tells_nan_from_nothing_and_reads_back_into_pandas(trial: Any) -> None:
    rows = trial_rows([trial(0, {"mean_success": math.nan}), trial(1, {"extra": 1})], {})
    data = as_parquet(rows)
    table = pyarrow.parquet.read_table(io.BytesIO(data))
    first, second = table["metrics.mean_success"].to_pylist()
    assert math.isnan(first)
    assert second == 1.0
    assert table["metrics.extra"].to_pylist() == [None, 1]
    assert table["levels.success"].to_pylist() == [row["levels.success"] for row in rows]
    frame = pandas.read_parquet(io.BytesIO(data))
    assert frame["seed"].tolist() == [0, 1]
    assert list(frame.columns) == columns_of(rows)


MIXED = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(2**53), 2**53),
    st.floats(),
    st.text(st.characters(exclude_categories=()), max_size=5),
    st.lists(st.floats(), max_size=2),
)


@example([{"a": "\ud800"}, {"b.c": "x"}])
@given(st.lists(st.dictionaries(st.sampled_from(["a", "b.c", "b.d"]), MIXED), min_size=1, max_size=4))
def test_whatever_a_record_holds_every_form_can_be_written(rows: list[dict[str, Any]]) -> None:
    for form, write in FORMS.items():
        assert isinstance(write(rows), bytes), form
    if columns_of(rows):
        table = pyarrow.parquet.read_table(io.BytesIO(as_parquet(rows)))
        assert table.num_rows == len(rows)
        for name in columns_of(rows):
            nothing = [row.get(name) is None for row in rows]
            assert [value is None for value in table[name].to_pylist()] == nothing


def test_columns_of_one_group_stand_together() -> None:
    assert columns_of([{"id": 1, "m.a": 1, "t.x": 1}, {"id": 2, "m.b": 1}]) == ["id", "m.a", "m.b", "t.x"]


def test_without_pyarrow_a_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(UserError, match=r"pip install evoclaims\[parquet\], or take --as json or csv"):
        as_parquet([{"a": 1}])


def test_a_verdict_is_a_row_with_the_numbers_of_the_whole_assertion() -> None:
    judged = report("G1", "refuted", case="a", statement="s, t", expected="refuted", verdict=verdict("refuted", p=0.03))
    broken = report("G2", "error", verdict=None)
    first, second = verdict_rows([judged, broken])
    assert (first["claim"], first["case"], first["n"], first["p"], first["expected"]) == (
        "G1",
        "a",
        10,
        0.03,
        "refuted",
    )
    assert (second["n"], second["p"], second["fingerprint"]) == (0, None, None)
    assert next(csv.DictReader(io.StringIO(as_csv([first, second]).decode())))["statement"] == "s, t"


@pytest.mark.parametrize(
    "text", ["=cmd|' /C calc'!A0", "+1", "-1", "@SUM(A1)", "\t=1+1", "\r=1+1", "\n=1+1", "\x1b[2J=1"]
)
def test_no_text_in_a_csv_file_is_calculated_or_steers_anything(text: str) -> None:
    written = as_csv([{"text": text, text: "heading", "number": -1.5, "count": -3, "list": [-1.0, 2.0]}]).decode()
    heading, cells = csv.reader(io.StringIO(written))
    assert cells[2:] == ["-1.5", "-3", "[-1.0, 2.0]"]
    for cell in (heading[1], cells[0]):
        assert cell[0] in "'\\"
        assert cell.isprintable()
        assert cell.lstrip("'") == printable(text)


@given(st.text(st.characters(exclude_categories=())))
def test_any_text_is_one_printable_cell_that_is_no_formula(text: str) -> None:
    _, (cell, end) = csv.reader(io.StringIO(as_csv([{"text": text, "end": 1}]).decode()))
    assert end == "1"
    assert cell.isprintable()
    assert not cell.startswith(("=", "+", "-", "@"))
