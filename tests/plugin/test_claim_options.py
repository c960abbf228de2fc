"""The options: each does what it says, and a wrong value is one sentence before the first trial."""

from __future__ import annotations

import json
import signal
from collections.abc import Callable
from shutil import rmtree
from typing import Any

import pytest

from evoclaims.judging.drift_report import DriftReport, DriftRow

Sentence = Callable[[pytest.RunResult, str], None]


def test_too_few_trials_are_underpowered_and_a_run_that_measured_nothing_does_not_end_well(project: Any) -> None:
    project.write(a="supported")
    result = project.run("--claims-trials=2", own_store=True)
    assert result.ret == pytest.ExitCode.NO_TESTS_COLLECTED
    result.stdout.fnmatch_lines(["[?] a: underpowered: needs n = 9 at alpha = 0.05"])
    result.stdout.fnmatch_lines(["No trial was looked at: nothing was measured."])
    assert not (project.path / ".evoclaims" / "trials").exists()


def test_a_number_of_trials_takes_the_place_of_the_tiers_own_and_one_measured_claim_makes_a_run(project: Any) -> None:
    project.write(
        a="verdict(trials('right', on='parity').success_everywhere_is(1.0).in_every_trial())",
        b="supported",
    )
    assert [report["outcome"] for report in project.json("--claims-trials=2")["claims"]] == [
        "supported",
        "inconclusive",
    ]
    assert project.run("--claims-trials=2").ret == 0
    assert [report["verdict"]["n"] for report in project.json("--claims-trials=12")["claims"]] == [12, 12]


@pytest.mark.parametrize(("choice", "status"), [("report", 0), ("fail", 1)])
def test_an_undecided_claim_ends_the_run_as_asked(project: Any, choice: str, status: int) -> None:
    project.write(a="undecided", b="supported")
    result = project.run(f"--claims-undecided={choice}")
    assert result.ret == status
    result.stdout.fnmatch_lines(["claims: 1 supported, 1 inconclusive"])


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("--claims-storage=afile",), "The trial store {path}/afile is a file, not a folder"),
        (("--claims-storage=afile/store",), "Cannot write {path}/afile/store"),
        (("--claims-device=gpu",), "finds no hardware for the device 'gpu'"),
        (("--claims-device=tpu",), "There is no device named 'tpu'. Did you mean 'gpu'? Known: auto, cpu, gpu."),
        (("--claims-trials=0",), "A look takes 1 to"),
    ],
)
def test_a_wrong_value_is_one_sentence_before_the_first_trial(
    project: Any, sentence: Sentence, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], text: str
) -> None:
    monkeypatch.setenv("JAX_PLATFORMS", "cpu")
    (project.path / "afile").write_text("not a folder")
    project.write(a="supported")
    result = project.run(*arguments, own_store=True)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    sentence(result, text.format(path=project.path))
    result.stdout.no_fnmatch_line("*collected * and nothing else*")
    assert not (project.path / ".evoclaims" / "trials").exists()


@pytest.mark.parametrize(
    ("pyproject", "text"),
    [
        ("[tool.evoclaims]\n", "needs a [tool.evoclaims] table with reproduction"),
        ('[tool.evoclaims]\nreproduction = "tiny_papr"\n', "There is no module 'tiny_papr' in"),
        ('[tool.evoclaims]\nreproduction = "json"\n', "The module 'json' has no REPRODUCTION"),
    ],
)
def test_a_project_that_is_not_set_up_is_one_sentence(
    project: Any, sentence: Sentence, pyproject: str, text: str
) -> None:
    project.write(a="supported")
    (project.path / "pyproject.toml").write_text(pyproject)
    result = project.run("claims", f"--rootdir={project.path}")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    sentence(result, text)


def test_stored_trials_alone_are_judged_without_running_or_writing_any(project: Any) -> None:
    project.write(a="supported")
    result = project.run("--claims-stored", "--junitxml=out.xml", own_store=True)
    assert result.ret == pytest.ExitCode.NO_TESTS_COLLECTED
    assert 'skipped="1"' in (project.path / "out.xml").read_text()  # a claim that is not run has not passed
    result.stdout.fnmatch_lines(["- a: right on parity: 10 of 10 trials are missing"])
    result.stdout.fnmatch_lines(["No claim was judged: nothing was measured."])
    assert not (project.path / ".evoclaims").exists()
    assert project.run(own_store=True).ret == 0
    before = sorted((project.path / ".evoclaims").rglob("*"))
    result = project.run("--claims-stored", own_store=True)
    assert result.ret == 0
    result.stdout.fnmatch_lines(["claims: 1 supported"])
    assert sorted((project.path / ".evoclaims").rglob("*")) == before


def test_a_second_run_runs_no_trial(project: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    project.write(a="supported", b="refuted")
    first = project.run(own_store=True)
    monkeypatch.setattr("evoclaims.trials.runner.Lanes", None)
    second = project.run(own_store=True)
    assert first.ret == second.ret == 1
    table = [line for line in first.outlines if line.startswith(("a ", "b "))]
    assert table == [line for line in second.outlines if line.startswith(("a ", "b "))]


def test_a_report_that_cannot_be_written_fails_the_run_and_hides_no_verdict(project: Any, sentence: Sentence) -> None:
    (project.path / "afile").write_text("not a folder")
    project.write(a="supported")
    result = project.run("--claims-json=afile/out.json")
    assert result.ret == pytest.ExitCode.TESTS_FAILED
    result.stdout.fnmatch_lines(["a *✓ supported*", "error: Cannot write *afile/out.json*", "claims: 1 supported"])
    sentence(result, "Name a file that can be written with --claims-json.")
    assert "--claims-storage" not in result.stdout.str()


def test_a_torn_reference_fails_the_run_and_does_not_keep_the_verdicts_from_being_written(project: Any) -> None:
    project.write(a="supported")
    torn = project.path / "reference" / "smoke" / "right-parity.jsonl"
    torn.parent.mkdir(parents=True)
    torn.write_text("torn\n")
    result = project.run("--claims-json=out.json")
    assert result.ret == pytest.ExitCode.TESTS_FAILED
    result.stdout.fnmatch_lines(
        ["error: Line 1 of *right-parity.jsonl is not a reference trial*", "claims: 1 supported"]
    )
    plain = json.loads((project.path / "out.json").read_text())
    assert [report["outcome"] for report in plain["claims"]] == ["supported"]
    assert plain["drift"] is None


def test_a_damaged_record_is_an_error_of_the_claims_that_need_it(project: Any, sentence: Sentence) -> None:
    from evoclaims.trials.store import Store

    project.write(a="supported", b="refuted")
    project.run(own_store=True)
    trials = json.loads((project.path / ".evoclaims/verdicts/smoke/a.json").read_text())["sources"][0]["trials"]
    record = Store(project.path / ".evoclaims").record_files(trials[3])[-1]
    record.write_bytes(record.read_bytes()[:99])
    result = project.run("--claims-only=a", own_store=True)
    assert result.ret == 1
    sentence(result, f"Cannot use {record}: it is not one whole JSON text; run `evoclaims verify`")
    result.stdout.fnmatch_lines(["claims: 1 error"])
    result = project.run("--claims-only=b", own_store=True)
    result.stdout.fnmatch_lines(["claims: 1 refuted"])


def test_a_device_without_enough_memory_is_a_sentence_of_the_claim(
    project: Any, sentence: Sentence, monkeypatch: pytest.MonkeyPatch
) -> None:
    import jax

    def advance(*arguments: object) -> None:
        raise jax.errors.JaxRuntimeError("RESOURCE_EXHAUSTED: Out of memory allocating 17179869184 bytes.")

    monkeypatch.setattr("evoclaims.trials.lanes.Lanes.advance", advance)
    project.write(a="supported")
    result = project.run(own_store=True)
    assert result.ret == 1
    sentence(result, "The device's memory does not hold 1 trial of hand_built on n_parity at once, and fewer cannot")


_REPEATS = "Tier(conditions(1), Design.fixed(10), repeat_drift=True)"


def test_trials_that_drifted_from_the_committed_ones_fail_the_run(
    project: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The references of the right network are swapped for what other trials gave."""
    from dataclasses import replace
    from pathlib import Path

    from evoclaims.core import provenance
    from evoclaims.paper import references
    from evoclaims.trials.result import digest
    from evoclaims.trials.store import Store

    known = {**provenance.collect(), "git": None}  # where code is not committed no drift is repeated
    monkeypatch.setattr(provenance, "_collected", lambda: known)
    project.write(a="supported")
    assert project.run(own_store=True).ret == 0
    path = references.path_of(project.path / "reference", "smoke", "right", "parity")
    stored = list(Store(Path(project.path / ".evoclaims")).results([]))
    references.write(path, stored)
    result = project.run(own_store=True)
    assert result.ret == 0
    result.stdout.fnmatch_lines(["reference trials: * comparisons, 0 drifted*", "to the bit: 10 trials *, 0 changed"])
    assert project.run("--claims-stored", "--claims-committed", own_store=True).ret == 0
    references.write(path, [replace(t, digest=digest("done", {"unread": 1.0}, {}, {}, b"")) for t in stored])
    result = project.run(own_store=True)
    assert result.ret == 0  # changed bits are counted, and fail no run
    result.stdout.fnmatch_lines(["reference trials: * 0 drifted*", "to the bit: 10 trials *, 10 changed: *"])
    worse = {"mean_success": 0.5}
    made = [replace(t, metrics={**t.metrics, **worse}, digest=digest("done", worse, {}, {}, b"")) for t in stored]
    references.write(path, made)
    result = project.run(own_store=True)
    assert result.ret == 1
    result.stdout.fnmatch_lines(
        [
            "*✓ supported*",
            "DRIFT in right on parity (smoke): mean_success is higher now: median 0.5 -> 1, A12 = 1.00, p = * (Holm)",
        ]
    )
    result.stdout.fnmatch_lines(
        ["to the bit: 10 trials compared with the same machine and versions, 10 changed: right on parity (10)"]
    )
    references.write(path, [replace(t, provenance={**t.provenance, "machine": "an abacus"}) for t in made])
    paper = project.path / "tiny_paper.py"
    before = paper.read_text()
    paper.write_text(before.replace("Tier(conditions(1), Design.fixed(10))", _REPEATS))
    result = project.run(own_store=True)
    assert result.ret == 1
    result.stdout.fnmatch_lines(
        [
            "evoclaims: right (smoke) has drifted; 3 times as many trials, with fresh seeds, tell this from chance",
            "DRIFT in right on parity (smoke): mean_success is higher now: *",
            "  it stands: 30 trials of each condition of right (smoke), with fresh seeds: DRIFT in right on parity *",
            "failed: trials of right on parity (smoke) (drift)",
        ]
    )
    project.run("-qq", "-s", own_store=True).stdout.no_fnmatch_line("*3 times as many trials*")
    none = DriftReport((DriftRow("right on parity (smoke)", "mean_success", 30, 10, "no drift"),), 0.05)
    monkeypatch.setattr("evoclaims.claims.earlier_trials.check_drift", lambda cases, alpha: none)
    result = project.run("--claims-json=verdicts.json", own_store=True)
    assert result.ret == 0
    result.stdout.fnmatch_lines(
        [
            "reference trials: * comparisons, 0 drifted*",
            "not repeated: right on parity (smoke): mean_success: median 0.5 -> 1, A12 = 1.00, p = * (Holm)",
            "failed: nothing",
        ]
    )
    rows = json.loads((project.path / "verdicts.json").read_text())["drift"]["rows"]
    assert {row["status"] for row in rows} == {"not repeated"}

    def interrupt(cases: object, alpha: float) -> DriftReport:
        written.extend(json.loads((project.path / "verdicts.json").read_text())["drift"]["rows"])
        signal.raise_signal(signal.SIGINT)
        return none

    written: list[dict[str, Any]] = []
    monkeypatch.setattr("evoclaims.claims.earlier_trials.check_drift", interrupt)
    result = project.run("--claims-json=verdicts.json", own_store=True)
    assert result.ret == 1
    assert {row["status"] for row in written} == {"drift"}  # a run that is killed now has written its verdicts
    result.stdout.fnmatch_lines(["  it stands: this was interrupted; the same command goes on from there"])
    paper.write_text(before)
    for options in (("--claims-stored",), ("--claims-stored", "--claims-committed")):
        result = project.run(*options, own_store=True)
        assert result.ret == 1
        result.stdout.fnmatch_lines(
            ["*✓ supported*", "DRIFT in right on parity (smoke): mean_success is higher now: *"]
        )
    rmtree(project.path / ".evoclaims")
    result = project.run("--claims-stored", "--claims-committed", own_store=True)
    assert result.ret == 0  # the committed trials are all there is, and nothing is compared with itself
    result.stdout.fnmatch_lines(["reference trials: 0 comparisons, 0 drifted*"])


def test_committed_trials_alone_would_be_judged_by_no_run_and_the_option_says_so(
    project: Any, sentence: Sentence
) -> None:
    project.write(a="supported")
    result = project.run("--claims-committed", own_store=True)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    sentence(result, "add --claims-stored, or leave it out.")
    assert not (project.path / ".evoclaims").exists()
