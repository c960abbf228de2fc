"""What a run says of trials that other versions have made: run again by default, mixed where any version will do."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
from tiny_project import out_of_time, trials_of

from evoclaims.paper import references
from evoclaims.trials.result import Status, digest
from evoclaims.trials.store import Store

HERE = version("numpy")
Sentence = Callable[[pytest.RunResult, str], None]


LATE = """

@pytest.fixture
def waits():
    import time
    from pathlib import Path
    while len(list(Path(".evoclaims/trials").glob("*/*.json"))) < 20:
        time.sleep(0.05)


@says("late")
def test_late(waits, trials, verdict):
    verdict(trials("right", on="parity").solves_every_level.in_most_trials())
"""
"""A claim with a fixture of its own."""


@pytest.fixture
def aged(project: Any, stored: Store) -> Callable[..., None]:
    """A function that makes a store of the claim `a` whose first `count` trials numpy 1.0 has made, all wrong."""
    project.write(a="supported")

    def age(count: int) -> None:
        folder = stored.root
        results = trials_of(stored, "hand_built")
        shutil.rmtree(folder)
        for result in results:
            if result.seed < count:
                metrics = {**result.metrics, "mean_success": 0.25}
                levels = {**result.levels, "success": tuple(0.25 for _ in result.levels["success"])}
                made_with = {**result.provenance["versions"], "numpy": "1.0"}
                result = replace(
                    result,
                    metrics=metrics,
                    levels=levels,
                    digest=digest(result.status, metrics, levels, result.curves, b""),
                    provenance={**result.provenance, "versions": made_with},
                )
            Store(folder).put(result, {})

    return age


def _lines(result: pytest.RunResult) -> list[str]:
    return [line.strip() for line in result.outlines]


def test_trials_of_other_versions_run_again_and_the_summary_says_what_that_changed(
    project: Any, aged: Callable[..., None]
) -> None:
    aged(10)
    assert project.run("--claims-any-version", own_store=True).ret == 1  # refuted by the wrong trials
    result = project.run("--claims-json=out.json", own_store=True)
    lines = _lines(result)
    start = lines.index(f"versions changed: numpy 1.0 -> {HERE}")
    assert (
        lines[start + 1] == "right on parity (smoke): 10 trials run again, 10 of 10 not the same to the bit as before"
    )
    end = next(at for at, line in enumerate(lines) if at > start and " comparisons with the trials made" in line)
    drift = lines[start + 2 : end]
    assert all(line.startswith("DRIFT in right on parity (smoke): ") for line in drift)
    assert any("mean_success is higher now: median 0.25 -> 1, A12 = 1.00, p = " in line for line in drift)
    assert lines[end].endswith(f" comparisons with the trials made before, {len(drift)} drifted")
    assert result.ret == 1  # supported, and yet something has drifted that nobody has looked at
    told = json.loads((project.path / "out.json").read_text())["upgrade"]["conditions"]
    assert [(one["condition"], one["again"], one["changed"]) for one in told] == [("right on parity (smoke)", 10, 10)]
    assert [(one["old"]["numpy"], one["new"]["numpy"]) for one in told] == [("1.0", HERE)]
    again = project.run(own_store=True)
    assert again.ret == 0
    lines = _lines(again)
    assert "right on parity (smoke): run again before, 10 of 10 not the same to the bit as before" in lines
    assert not [line for line in lines if "compiling" in line]


def test_trials_that_other_processes_ran_again_before_their_claim_was_due_count_as_such(
    project: Any, aged: Callable[..., None]
) -> None:
    """The claim `late` is the first, as nothing is known of its trials; it waits until those of `a` are there."""
    aged(10)
    file = project.path / "claims" / "test_claims.py"
    file.write_text(file.read_text() + LATE)
    result = project.run("--claims-processes=2", own_store=True)
    lines = _lines(result)
    assert "right on parity (smoke): 10 trials run again, 10 of 10 not the same to the bit as before" in lines
    assert result.ret == 1


def test_a_part_of_a_conditions_trials_runs_again_alone(project: Any, aged: Callable[..., None]) -> None:
    aged(3)
    lines = _lines(project.run(own_store=True))
    assert "right on parity (smoke): 3 trials run again, 3 of 3 not the same to the bit as before" in lines


def test_a_claim_that_looks_at_no_trial_compares_none(project: Any, aged: Callable[..., None]) -> None:
    aged(10)
    lines = _lines(project.run("--claims-trials=2", own_store=True))
    assert "claims: 1 inconclusive" in lines
    assert not [line for line in lines if line.startswith(("versions changed", "error:"))]


def test_bits_are_not_said_to_be_unchanged_where_versions_differ(project: Any, aged: Callable[..., None]) -> None:
    from evoclaims.paper import references

    aged(10)
    trials = Store(project.path / ".evoclaims").results([])
    references.write(references.path_of(project.path / "reference", "smoke", "right", "parity"), trials)
    result = project.run(own_store=True)
    sentence = "to the bit: no trial could be compared, since *none has a reference of the same *machine and versions"
    result.stdout.fnmatch_lines(["DRIFT in right on parity (smoke): mean_success is higher now*", sentence])


def test_whatever_is_there_is_judged_and_the_table_says_that_its_versions_are_mixed(
    project: Any, aged: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    aged(5)
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(project.path / "page.md"))
    result = project.run("--claims-any-version", own_store=True)
    lines = _lines(result)
    assert f"† trials of mixed versions: numpy 1.0 and {HERE}: a (smoke)" in lines
    assert any("inconclusive†" in line for line in lines)
    assert not [line for line in lines if "compiling" in line or line.startswith("versions changed")]
    page = (project.path / "page.md").read_text()
    assert "inconclusive†" in page
    assert "† trials of mixed versions" in page


@pytest.mark.parametrize("status", ["crashed", "timeout"])
def test_drift_is_that_of_the_judged_trials_and_not_of_newer_ones_without_an_end(
    project: Any, aged: Callable[..., None], status: Status
) -> None:
    aged(0)
    store = Store(project.path / ".evoclaims")
    sound = trials_of(store, "hand_built")
    references.write(references.path_of(project.path / "reference", "smoke", "right", "parity"), sound)
    aged(10)
    for trial in sound:
        store.put(replace(out_of_time(trial), status=status, digest=digest(status, {}, {}, trial.curves, b"")), {})
    lines = _lines(project.run("--claims-any-version", own_store=True))
    assert any(
        line.startswith("DRIFT in right on parity (smoke): mean_success is lower now: median 1 -> 0.25")
        for line in lines
    )


def test_trials_of_one_other_environment_are_told_with_what_is_installed(
    project: Any, aged: Callable[..., None], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from evoclaims.cli import main

    aged(10)
    monkeypatch.chdir(project.path)
    capsys.readouterr()
    main(["status"])
    out = " ".join(capsys.readouterr().out.split())
    assert f"trials from other versions than the installed ones: numpy 1.0 (installed: {HERE}): a (smoke)" in out
    assert "†" not in out
    assert "1 refuted" in out


def test_a_plan_counts_trials_of_other_versions_as_missing(
    project: Any, aged: Callable[..., None], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from evoclaims.cli import main

    aged(4)
    monkeypatch.chdir(project.path)
    capsys.readouterr()
    main(["plan"])
    (row,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("right on parity")]
    assert row.split()[3:5] == ["6", "4"]


def test_references_are_of_one_environment(
    project: Any, aged: Callable[..., None], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from evoclaims.cli import main
    from evoclaims.paper import references

    monkeypatch.chdir(project.path)
    path = references.path_of(Path.cwd() / "reference", "smoke", "right", "parity")
    aged(5)
    assert main(["reference", "--unknown-revision"]) != 0
    assert not path.exists()
    aged(10)
    capsys.readouterr()
    assert main(["reference", "--unknown-revision"]) == 0
    said = f"wrote {path}: 10 trials, made with other versions than are installed: numpy 1.0 -> {HERE}\n"
    assert said in capsys.readouterr().out
    assert {trial.provenance["versions"]["numpy"] for trial in references.load(path)} == {"1.0"}
    project.run(own_store=True)
    assert main(["reference", "--unknown-revision"]) == 0
    assert {trial.provenance["versions"]["numpy"] for trial in references.load(path)} == {HERE}
