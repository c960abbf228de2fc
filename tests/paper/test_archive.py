"""Trials are found in the store, else among the committed reference trials."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from evoclaims.core.errors import UserError
from evoclaims.core.packages import without_flags
from evoclaims.paper import references
from evoclaims.paper.archive import Archive
from evoclaims.paper.reproduction import Reproduction
from evoclaims.trials.store import Store


def test_the_store_comes_first_and_the_committed_trials_fill_in(
    tmp_path: Path, store: Store, made: Any, reproduction: Reproduction
) -> None:
    condition = reproduction.tier("smoke").condition("better", "small")
    ours, theirs = made(condition, 0, 1.0), made(condition, 0, 0.0)
    committed = [replace(theirs, provenance={"from": "file"}), made(condition, 1, 0.5)]
    store.put(ours, {})
    references.write(references.path_of(tmp_path / "reference", "smoke", "better", "small"), committed)
    archive = Archive(store, tmp_path / "reference")
    found = archive.trials(condition, [1, 0, 2])
    assert [trial and trial.metrics["mean_success"] for trial in found] == [0.5, 1.0, None]
    assert Archive(store).trials(condition, [1, 0])[0] is None


def test_a_committed_trial_comes_before_one_that_ran_out_of_time(
    tmp_path: Path, store: Store, made: Any, reproduction: Reproduction
) -> None:
    condition = reproduction.tier("smoke").condition("better", "small")
    for seed in (0, 1):
        store.put(made(condition, seed, 0.0, "timeout"), {})
    references.write(references.path_of(tmp_path / "reference", "smoke", "better", "small"), [made(condition, 0, 1.0)])
    found = Archive(store, tmp_path / "reference").trials(condition, [0, 1])
    assert [trial and trial.status for trial in found] == ["done", "timeout"]


def test_a_stored_trial_of_other_versions_comes_before_one_that_ran_out_of_time_here(
    store: Store, made: Any, reproduction: Reproduction
) -> None:
    condition = reproduction.tier("smoke").condition("better", "small")
    here, packages = dict(condition.versions), list(condition.versions)
    store.put(made(condition, 0, 0.0, "timeout", versions=here, depends_on=packages), {})
    store.put(made(condition, 0, 1.0, versions={**here, "jax": "0.0.1"}, depends_on=packages), {})
    assert len(store.records(made(condition, 0, 1.0).id)) == 2
    assert [trial and trial.status for trial in Archive(store).trials(condition, [0])] == ["done"]


def test_what_is_judged_is_stored_unless_a_committed_trial_goes_before_it(
    tmp_path: Path, store: Store, made: Any, reproduction: Reproduction
) -> None:
    condition = reproduction.tier("smoke").condition("better", "small")
    here, packages = without_flags(condition.versions), list(condition.packages)
    ours = {"versions": here, "depends_on": packages}
    older = {"versions": {**here, "jax": "0.0.1"}, "depends_on": packages}
    for seed, status, provenance in ((0, "done", ours), (1, "done", older), (2, "timeout", ours), (3, "done", older)):
        store.put(made(condition, seed, 1.0, status, **provenance), {})
    committed = [made(condition, seed, 1.0, **ours) for seed in (0, 1, 2, 4)]
    references.write(references.path_of(tmp_path / "reference", "smoke", "better", "small"), committed)
    archive = Archive(store, tmp_path / "reference")
    ids = [made(condition, seed, 1.0).id for seed in range(6)]
    assert [archive.get(trial, here) is not None for trial in ids] == [True, True, True, True, True, False]
    assert [archive.stored(trial, here) is not None for trial in ids] == [True, False, False, True, False, False]


def test_an_edited_line_is_an_error_of_who_reads_it_and_a_line_that_is_no_trials_of_everyone(
    tmp_path: Path, store: Store, made: Any, reproduction: Reproduction
) -> None:
    conditions = [reproduction.tier("smoke").condition(method, "small") for method in ("better", "worse")]
    paths = [references.path_of(tmp_path, "smoke", method, "small") for method in ("better", "worse")]
    for condition, path in zip(conditions, paths, strict=True):
        references.write(path, [made(condition, seed, 1.0) for seed in (0, 1)])
    paths[0].write_bytes(paths[0].read_bytes().replace(b'"seed":1', b'"seed":3'))
    archive = Archive(store, tmp_path)
    archive.check()
    assert [trial is not None for trial in archive.trials(conditions[1], [0, 1, 2])] == [True, True, False]
    with pytest.raises(UserError, match="Line 2 of .* is not a reference trial"):
        archive.trials(conditions[0], [0])
    paths[0].write_bytes(b"{}\n")
    with pytest.raises(UserError, match="Line 1 of .* is not a reference trial"):
        Archive(store, tmp_path).check()
