"""`evoclaims export`: the files that it writes."""

from __future__ import annotations

import json
from pathlib import Path

import pandas
import pandas.core.arrays.arrow.extension_types  # registers types, once: pytester forgets what tests import
import pytest
from tiny_project import Evoclaims, forget, trials_of

from evoclaims.paper import references
from evoclaims.trials.store import Store


@pytest.fixture
def exported(evoclaims: Evoclaims, stored: Store) -> Evoclaims:
    """A function that runs a command on ten trials of the right network and two of the wrong one."""
    forget(stored, [trial for trial in trials_of(stored, "hand_built_negated") if trial.seed >= 2])
    return evoclaims


def test_trials_are_exported_in_each_form(exported: Evoclaims) -> None:
    for form in ("json", "csv", "parquet"):
        assert exported("export", "--as", form) == (0, f"wrote report/trials.{form}: 12 trials\n", "")
    plain = json.loads(Path("report/trials.json").read_text())
    assert plain["schema"] == 1
    for table in (
        pandas.DataFrame(plain["rows"]),
        pandas.read_csv("report/trials.csv"),
        pandas.read_parquet("report/trials.parquet"),
    ):
        assert table.groupby("method")["metrics.mean_success"].agg(["size", "mean"]).to_dict("index") == {
            "right": {"size": 10, "mean": 1.0},
            "wrong": {"size": 2, "mean": 0.0},
        }
        assert set(table["tier"]) == {"smoke"}
        assert table["provenance.versions.jax"].notna().all()


def test_a_tier_without_trials_is_one_sentence(exported: Evoclaims) -> None:
    assert exported("export", "--tier=smoke")[0] == 0
    status, _, err = exported("export", "--tier=full")
    assert (status, err.count("\n")) == (2, 1)
    assert "Neither .evoclaims nor the reference trials hold a trial of this tier; `evoclaims run` runs some." in err
    assert "There is no form named 'xml'. Known: csv, json, parquet." in exported("export", "--as=xml")[2]


def test_reference_trials_fill_in_what_the_store_lacks(exported: Evoclaims) -> None:
    trials = list(Store(Path(".evoclaims")).results([]))
    references.write(references.path_of(Path("reference"), "smoke", "right", "parity"), trials)
    Path("elsewhere").mkdir()
    status, out, _ = exported("export", "--storage=elsewhere", "--out=here/t.json")
    assert (status, out) == (0, "wrote here/t.json: 12 trials\n")
    assert exported("export")[1] == "wrote report/trials.json: 12 trials\n"


def test_a_damaged_record_is_left_out_and_said(exported: Evoclaims) -> None:
    store = Store(Path(".evoclaims"))
    path = store.record_files(store.ids()[0])[-1]
    path.write_text("torn")
    status, out, err = exported("export")
    assert (status, out) == (1, "wrote report/trials.json: 11 trials\n")
    assert f"left out: Cannot use {path}: it is not one whole JSON text" in err


def test_files_go_into_folders_that_git_leaves_alone(exported: Evoclaims) -> None:
    exported("export")
    assert exported("export", "--out=shown/it.json")[0] == 0
    assert Path("report/.gitignore").read_text() == "*\n"
    assert not Path("shown/.gitignore").exists()  # the user's own
    Path("report/.gitignore").unlink()
    assert exported("export")[0] == 0
    assert not Path("report/.gitignore").exists()  # who deletes it wants to commit the folder
