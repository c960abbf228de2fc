"""Tables of results that another program has made, read as trials: what is taken, and what is refused."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from decimal import Decimal
from pathlib import Path
from typing import Any

import pyarrow
import pyarrow.parquet
import pytest

from evoclaims.core.errors import UserError
from evoclaims.trials.imported import Imported
from evoclaims.trials.result_codec import dump, parse
from evoclaims.trials.runner import run
from evoclaims.trials.store import Store

pytestmark = pytest.mark.oldest

TABLE = """\
seed,algo,lr,return,length
42,sac,0.001,30.5,100
7,sac,0.001,10.5,90
1337,sac,1e-3,20.5,80
7,ppo,0.01,-4,70
"""
SAC = {"algo": "sac"}


@pytest.fixture
def table(tmp_path: Path) -> Callable[..., Imported]:
    """A function that writes a table and returns the condition that reads it."""

    def make(text: str = TABLE, name: str = "runs.csv", **settings: Any) -> Imported:
        (tmp_path / name).write_text(text, encoding="utf-8")
        return Imported(name, **{"seed": "seed", "metric": "return", "folder": tmp_path, **settings})

    return make


def _values(condition: Imported, metric: str = "return") -> list[float]:
    return [trial.metrics[metric] for trial in condition.existing]


def test_the_trial_of_seed_k_is_that_of_the_table_s_kth_smallest_seed(table: Callable[..., Imported]) -> None:
    trials = table(where=SAC).existing
    assert [trial.seed for trial in trials] == [0, 1, 2]
    assert [trial.provenance["seed_in_table"] for trial in trials] == ["7", "42", "1337"]
    assert [trial.metrics for trial in trials] == [{"return": 10.5}, {"return": 30.5}, {"return": 20.5}]


def test_a_record_says_what_was_imported_by_whom_and_from_which_file(table: Callable[..., Imported]) -> None:
    condition = table(where=SAC, by="Ada, with CleanRL 1.0")
    for trial in condition.existing:
        assert parse(dump(trial)) == trial
        assert trial.provenance["imported"] == {
            "file": "runs.csv",
            "sha256": condition.table.sha256,
            "by": "Ada, with CleanRL 1.0",
        }
        assert trial.device == {}
    assert condition.packages == ()


@pytest.mark.parametrize("lr", [0.001, "0.001"])
def test_filters_know_numbers_and_texts(table: Callable[..., Imported], lr: object) -> None:
    assert _values(table(where={"lr": lr})) == ([10.5, 30.5, 20.5] if lr == 0.001 else [10.5, 30.5])


@pytest.mark.parametrize("form", ["csv", "jsonl"])
def test_filters_know_all_digits_of_a_whole_number(table: Callable[..., Imported], form: str) -> None:
    rows = [(1, 2**53, 10.5), (2, 2**53 + 1, 20.5)]
    lines = ["seed,run,return", *(",".join(map(str, row)) for row in rows)]
    if form == "jsonl":
        lines = [json.dumps(dict(zip(("seed", "run", "return"), row, strict=True))) for row in rows]
    for _, number, value in rows:
        assert _values(table("\n".join(lines), f"runs.{form}", where={"run": number})) == [value]


@pytest.mark.parametrize("said", ["true", "True", "TRUE", "1"])
def test_filters_know_true_however_it_is_written(table: Callable[..., Imported], said: str) -> None:
    assert _values(table(f"seed,return,done\n1,5,{said}\n2,6,no\n", where={"done": True})) == [5]


@pytest.mark.parametrize(
    ("cells", "wanted", "said"),
    [
        (
            ["a", "a ", "a ", "b"],
            "a",
            r"holds 'a ' in row 2 of the column 'algo', which is 'a' but for blanks, and .*2",
        ),
        (["a ", "b"], "a", "holds 'a ' in row 1"),
        (["a", "a "], "a ", "holds 'a' in row 1 of the column 'algo', which is 'a ' but for blanks"),
        (["true", "True\u00a0"], True, "which is True but for blanks"),
        (["0.1", "0.10000000149"], 0.1, r"holds '0\.10000000149' in row 2 .*, which is 0\.1 in 32 bits alone"),
        (["0.10000000149", "0.2"], 0.1, r"no row whose algo is 0\.1\. In 32 bits it is equal to 0\.10000000149: write"),
        (["0.10000000149", *(f"{k}.5" for k in range(50))], 0.1, r"In 32 bits it is equal to 0\.10000000149: write"),
    ],
)
def test_no_row_is_left_out_whose_value_is_only_written_otherwise(
    table: Callable[..., Imported], cells: list[str], wanted: object, said: str
) -> None:
    text = "seed,return,algo\n" + "".join(f"{seed},{seed},{cell}\n" for seed, cell in enumerate(cells))
    with pytest.raises(UserError, match=said):
        _ = table(text, where={"algo": wanted}).existing


def test_rows_that_another_filter_leaves_out_may_be_written_otherwise(table: Callable[..., Imported]) -> None:
    text = "seed,return,env,lr\n1,5,stones,0.1\n2,6,stones ,0.2\n3,7,maze,0.10000000149\n"
    assert _values(table(text, where={"env": "stones", "lr": 0.1})) == [5]
    with pytest.raises(UserError, match="holds 'stones ' in row 2"):
        _ = table(text, where={"env": "stones"}).existing


def test_numbers_that_differ_in_32_bits_and_whole_ones_are_told_apart(table: Callable[..., Imported]) -> None:
    text = "seed,return,run\n1,5,16777216\n2,6,16777217\n3,7,0.1\n4,8, 0.1\n5,9,0.1000001\n6,9,1e300\n7,9,nan\n"
    assert _values(table(text, where={"run": 16777217.0})) == [6]
    assert _values(table(text, where={"run": 0.1})) == [7, 8]


@pytest.mark.parametrize(
    "seeds", [[9007199254740992, 9007199254740993], [2**64 - 2, 2**64 - 1], [-(10**38), 310441253894826263190129434872]]
)
@pytest.mark.parametrize("form", ["csv", "json"])
def test_seeds_of_any_size_are_told_apart_and_kept(table: Callable[..., Imported], seeds: list[int], form: str) -> None:
    rows = [{"seed": seed, "return": k} for k, seed in enumerate(seeds)]
    text = json.dumps(rows) if form == "json" else "seed,return\n" + "".join(f"{s},{k}\n" for k, s in enumerate(seeds))
    trials = table(text, f"runs.{form}").existing
    assert [trial.metrics["return"] for trial in trials] == [0, 1]
    assert [trial.provenance["seed_in_table"] for trial in trials] == list(map(str, seeds))
    assert [parse(dump(trial)) for trial in trials] == list(trials)


def test_metrics_are_named_as_columns_or_as_measures_read_them(table: Callable[..., Imported]) -> None:
    assert _values(table(metric=["return", "length"], where=SAC), "length") == [90, 100, 80]
    assert _values(table(metric={"last_fitness": "return"}, where=SAC), "last_fitness") == [10.5, 30.5, 20.5]


def _rows() -> list[dict[str, Any]]:
    head, *lines = (line.split(",") for line in TABLE.splitlines())
    texts = [dict(zip(head, line, strict=True)) for line in lines]
    return [{name: cell if name == "algo" else float(cell) for name, cell in row.items()} for row in texts]


@pytest.mark.parametrize("form", ["tsv", "json", "jsonl", "parquet"])
def test_every_form_of_a_table_gives_the_same_trials(table: Callable[..., Imported], form: str) -> None:
    condition = table(where=SAC)
    texts = {
        "tsv": TABLE.replace(",", "\t"),
        "json": json.dumps(_rows()),
        "jsonl": "\n".join(map(json.dumps, _rows())),
        "parquet": "",
    }
    other = table(texts[form], f"runs.{form}", where=SAC)
    if form == "parquet":
        pyarrow.parquet.write_table(pyarrow.Table.from_pylist(_rows()), other.folder / other.path)
    assert [trial.metrics for trial in other.existing] == [trial.metrics for trial in condition.existing]
    assert [trial.digest for trial in other.existing] == [trial.digest for trial in condition.existing]


@pytest.mark.parametrize("value", ["nan", "inf", "-Infinity"])
def test_a_trial_whose_number_is_not_finite_has_diverged(table: Callable[..., Imported], value: str) -> None:
    trials = table(TABLE.replace("30.5", value), where=SAC).existing
    assert [trial.status for trial in trials] == ["done", "diverged", "done"]
    parse(dump(trials[1]))


def test_an_empty_cell_is_refused_unless_it_is_said_to_mean_divergence(table: Callable[..., Imported]) -> None:
    text = TABLE.replace("30.5", "")
    with pytest.raises(UserError, match=r"runs\.csv has no number in row 1 of the column 'return': write nan"):
        _ = table(text, where=SAC).existing
    trials = table(text, where=SAC, empty_means_diverged=True).existing
    assert [trial.status for trial in trials] == ["done", "diverged", "done"]
    curves = "seed,step,return\n1,10,90\n1,20,\n2,10,\n2,20,30\n"  # of a curve, the last cell counts
    assert _values(table(curves, step="step")) == [90, 30]
    trials = table(curves, step="step", empty_means_diverged=True).existing
    assert [trial.status for trial in trials] == ["diverged", "done"]


@pytest.mark.parametrize("value", [math.nan, None])
def test_parquet_tells_nan_from_an_empty_cell(table: Callable[..., Imported], value: float | None) -> None:
    condition = table("", "runs.parquet")
    columns = {"seed": [Decimal(1)], "return": pyarrow.array([value], pyarrow.float64(), from_pandas=False)}
    pyarrow.parquet.write_table(pyarrow.table(columns), condition.folder / condition.path)
    if value is not None:
        assert [trial.status for trial in condition.existing] == ["diverged"]
        return
    with pytest.raises(UserError, match=r"runs\.parquet has no number in row 1 of the column 'return'"):
        _ = condition.existing


CURVES = """\
seed,global_step,return,loss
3,200,5.0,0.1
3,100,2.0,0.2
1,100,1.0,0.3
1,300,,0.4
1,200,4.0,
"""


def test_rows_with_steps_are_a_curve_whose_last_number_counts(table: Callable[..., Imported]) -> None:
    one, three = table(CURVES, metric=["return", "loss"], step="global_step").existing
    assert three.metrics == {"return": 5.0, "loss": 0.1, "environment_steps": 200}
    assert one.metrics == {"return": 4.0, "loss": 0.4, "environment_steps": 300}
    assert three.curves == {"environment_steps": (100, 200), "return": (2.0, 5.0), "loss": (0.2, 0.1)}
    assert one.curves["return"][:2] == (1.0, 4.0)
    assert math.isnan(one.curves["return"][2])
    assert parse(dump(one)).digest == one.digest


def test_the_budget_of_curves_is_the_longest_and_its_reports_are_as_far_apart_as_they_ever_are(
    table: Callable[..., Imported],
) -> None:
    condition = table(CURVES.replace("3,100", "3,150"), step="global_step")
    assert condition.environment_steps == 300
    assert condition.report_distance == 150
    assert table(where=SAC).environment_steps == 0


def test_another_table_or_another_reading_of_it_is_another_condition(table: Callable[..., Imported]) -> None:
    ids = [
        table(where=SAC).id,
        table(where=SAC, by="Ada").id,
        table(metric="length", where=SAC).id,
        table(where={"algo": "ppo"}).id,
        table(TABLE.replace("30.5", "30.6"), where=SAC).id,
    ]
    assert len(set(ids)) == len(ids)
    (table().folder / "deep").mkdir()
    deep = table(name="deep/runs.csv").folder / "deep" / "runs.csv"
    assert table(where=SAC).id == Imported(deep, "seed", "return", where=SAC).id == ids[0]  # wherever the folder is


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"seed": "sed"}, r"There is no column in runs\.csv \(the seeds\) named 'sed'\. Did you mean 'seed'\? Known: "),
        ({"metric": "retrun", "where": SAC}, r"\(a metric\) named 'retrun'\. Did you mean 'return'\?"),
        ({"where": {"alg": "sac"}}, r"named 'alg'\. Did you mean 'algo'\?"),
        ({"where": {"algo": "sca"}}, r"runs\.csv has no row whose algo is 'sca'\. Did you mean 'sac'\? Known: ppo,"),
        ({"where": {"algo": "ppo", "lr": 0.001}}, r"runs\.csv has no row with algo 'ppo' and lr 0\.001\."),
        ({}, r"runs\.csv has 2 rows of seed 7 \(rows 2 and 4\), and a row is a trial\. Choose among them by where="),
        (
            {"metric": "algo", "where": SAC},
            r"runs\.csv holds 'sac' in row 2 of the column 'algo', which is not a number",
        ),
        ({"seed": "lr"}, r"Row 1 of runs\.csv has the seed 0\.001 in the column 'lr': each trial has a whole number"),
        ({"path": "gone.csv"}, r"The table .*gone\.csv cannot be read: No such file"),
        ({"path": "runs.xlsx"}, r"runs\.xlsx is not a table that can be read. Its name must end in \.csv, "),
        ({"metric": ""}, r"Imported\('runs\.csv'\) names no metric"),
        ({"metric": 3}, r"Imported\('runs\.csv'\) has metric=3\. Write the name of a column, or several\."),
        ({"metric": ["return", 3]}, r"has metric=\['return', 3\]\. Write a column's name, or several, or columns by"),
        ({"metric": {3: "return"}}, r"has metric={3: 'return'}\. Write a column's name, or several, or columns by"),
        ({"where": ["algo"]}, r"has where=\['algo'\]\. Write values by column, such as"),
        ({"path": 3}, r"Imported\('3'\) has path=3\. Write the path of a table\."),
        ({"empty_means_diverged": "no"}, r"has empty_means_diverged='no'\. Write True or False\."),
        (
            {"metric": ["return", "environment_steps"], "step": "lr"},
            r"Imported\('runs\.csv'\) has two columns of environment steps: 'environment_steps' and step='lr'",
        ),
        (
            {"metric": {"last_success": "return"}, "where": SAC},
            r"Seed 7 of runs\.csv reports a last_success of 10\.5\. A success is a share from 0 to 1",
        ),
        ({"metric": {"mean_success": "return"}, "where": {"algo": "ppo"}}, "reports a mean_success of -4"),
        ({"metric": {"success": "return"}, "where": {"algo": "ppo"}, "step": "length"}, "reports a success of -4"),
    ],
)
def test_what_does_not_fit_is_a_sentence_with_the_file_and_what_is_there(
    table: Callable[..., Imported], settings: dict[str, Any], said: str
) -> None:
    usual = {"path": "runs.csv", "seed": "seed", "metric": "return", "folder": table().folder}
    (table().folder / "runs.xlsx").touch()
    with pytest.raises(UserError, match=said):
        _ = Imported(**usual | settings).existing


def test_a_parquet_file_with_two_columns_of_one_name_is_a_sentence(table: Callable[..., Imported]) -> None:
    condition = table("", "runs.parquet")
    twice = pyarrow.Table.from_arrays([[1], [2], [3]], names=["seed", "return", "return"])
    pyarrow.parquet.write_table(twice, condition.folder / condition.path)
    with pytest.raises(UserError, match=r"two of its columns have one name \(seed, return, return\)"):
        _ = condition.existing


def test_a_line_separator_within_a_text_ends_no_line_of_json(table: Callable[..., Imported]) -> None:
    assert _values(table('{"seed":1,"return":2,"note":"a\u2028b"}\r\n{"seed":2,"return":3}\r\n', "runs.jsonl")) == [
        2,
        3,
    ]


@pytest.mark.parametrize("cell", ["1_0", '"1,000"', "0x1F", "1;5"])
def test_what_only_some_programs_take_for_a_number_is_none(table: Callable[..., Imported], cell: str) -> None:
    with pytest.raises(UserError, match=r"in row 1 of the column 'return', which is not a number"):
        _ = table(f"seed,return\n1,{cell}\n").existing


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            CURVES.replace("3,100", "3,200"),
            r"two rows of seed 3 and global_step 200 \(rows 1 and 2\): if there are several",
        ),
        (CURVES.replace("3,100", "3,"), "Row 2 of .* has no step in the column 'global_step': write .* whole numbers"),
        *(
            (
                CURVES.replace("3,100", f"3,{step}"),
                f"Row 2 of .* has the step {step} in the column 'global_step': write",
            )
            for step in ("-1.0", "100.5", "nan", "inf")
        ),
    ],
)
def test_each_row_of_a_curve_has_a_step_of_its_own(table: Callable[..., Imported], text: str, said: str) -> None:
    with pytest.raises(UserError, match=said):
        _ = table(text, step="global_step").existing


def test_the_runner_stores_them_once_and_runs_nothing(table: Callable[..., Imported], store: Store) -> None:
    condition = table(where=SAC)
    found = run(condition, range(10), store, [])
    assert [trial.metrics["return"] for trial in found] == [10.5, 30.5, 20.5]
    assert set(store.ids()) == {trial.id for trial in found}
    before = [path.stat().st_mtime_ns for path in store.record_paths()]
    run(condition, [1], store, [])
    assert [path.stat().st_mtime_ns for path in store.record_paths()] == before
