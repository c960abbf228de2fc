"""Pipes, links to nowhere and folders where files belong: nobody waits for them, and nobody trips over them."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from evoclaims.cli.jobs import last_words
from evoclaims.core.errors import UserError
from evoclaims.core.files import read_file
from evoclaims.judging.verdict import Outcome
from evoclaims.paper import references
from evoclaims.paper.config import load_config
from evoclaims.paper.reported import load_published
from evoclaims.trials import checkpoint
from evoclaims.trials.integrity import verify
from evoclaims.trials.lease import progress_path, shared
from evoclaims.trials.progress import RunProgress, ignore
from evoclaims.trials.result import TrialResult
from evoclaims.trials.store import DamagedFileError, Store
from evoclaims.verdicts import history
from evoclaims.verdicts.claim_report import ClaimReport, evidence_path, save

pytestmark = pytest.mark.oldest


@pytest.fixture(autouse=True)
def impatient() -> Iterator[None]:
    """Fail a test that waits for a pipe, instead of waiting with it."""

    def give_up(*_: Any) -> None:
        raise AssertionError("it waits for a pipe")

    before = signal.signal(signal.SIGALRM, give_up)
    signal.alarm(20)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def as_folder(path: Path) -> None:
    path.mkdir()


def as_circle(path: Path) -> None:
    path.symlink_to(path.name)


def as_link_to_nowhere(path: Path) -> None:
    path.symlink_to("nowhere")


def as_endless_device(path: Path) -> None:
    path.symlink_to("/dev/zero")


def as_brackets(path: Path) -> None:
    path.write_text("[" * 200_000 + "]" * 200_000)


ODD: list[Callable[[Path], None]] = [os.mkfifo, as_folder, as_circle, as_endless_device]
LONG = "a" * 64


@pytest.mark.parametrize("make", ODD)
def test_an_odd_file_of_a_store_is_a_damaged_file_that_verify_moves_aside(
    store: Store, trial: TrialResult, make: Callable[[Path], None]
) -> None:
    champion, record = store.champion_path(trial.id), store.record_path(trial.id)
    champion.unlink()
    make(champion)
    with pytest.raises(DamagedFileError, match="it cannot be read"):
        store.champion_of(trial_in(store, trial))
    assert record in {problem.path for problem in verify(store, repair=False)}
    record.unlink()
    make(record)
    with pytest.raises(DamagedFileError, match="it cannot be read"):
        store.get(trial.id)
    assert record in {problem.path for problem in verify(store, repair=True)}
    assert store.get(trial.id) is None
    store.checkpoints.mkdir(parents=True)
    make(store.checkpoints / f"{LONG}-{'b' * 16}.npz")
    with pytest.raises(DamagedFileError, match="not a (file|readable checkpoint)"):
        checkpoint.find(store.checkpoints, LONG, "platform")


def trial_in(store: Store, trial: TrialResult) -> TrialResult:
    """Return a trial as it is stored."""
    found = store.get(trial.id)
    assert found is not None
    return found


@pytest.mark.parametrize("make", [*ODD, as_link_to_nowhere, as_brackets])
def test_an_odd_file_of_a_project_is_a_sentence_and_one_of_evidence_is_replaced(
    tmp_path: Path, make: Callable[[Path], None]
) -> None:
    path = tmp_path / "better-small.jsonl"
    make(path)
    with pytest.raises(UserError, match=r"better-small\.jsonl .*Restore the file"):
        references.load(path)
    if make not in (as_link_to_nowhere, as_brackets):  # no file, and a text
        make(tmp_path / "pyproject.toml")
        for load in (load_published, history.load):
            with pytest.raises(UserError, match="Cannot read"):
                load(tmp_path / "pyproject.toml")
        with pytest.raises(UserError, match="Cannot read"):
            load_config(tmp_path)
        assert last_words(tmp_path / "pyproject.toml") == ""  # of a job's log
    report = ClaimReport("A", "", "smoke", "it is", "§1", Outcome.SUPPORTED, "so it is")
    evidence = evidence_path(report, tmp_path)
    evidence.parent.mkdir(parents=True)
    make(evidence)
    saved = save(report, tmp_path)
    assert bool(saved.unsaved) == (make is as_folder)
    assert make is as_folder or ClaimReport.from_json(json.loads(evidence.read_text())) == saved


def test_what_leads_nowhere_or_has_no_name_that_a_file_can_have_is_not_there(store: Store, tmp_path: Path) -> None:
    store.checkpoints.mkdir(parents=True)
    as_link_to_nowhere(store.checkpoints / f"{LONG}-{'b' * 16}.npz")
    assert not list(checkpoint.find(store.checkpoints, LONG, "platform"))
    assert references.load(references.path_of(tmp_path, "smoke", "m" * 300, "task")) == ()
    as_link_to_nowhere(tmp_path / "1_0_log.out")
    assert last_words(tmp_path / "1_0_log.out") == ""


def test_a_pipe_where_progress_is_shared_keeps_nobody_waiting(tmp_path: Path) -> None:
    path = progress_path(tmp_path, LONG)
    path.parent.mkdir(parents=True)
    os.mkfifo(path)
    with shared(tmp_path, LONG, ignore) as tell:
        tell(RunProgress("a on b", "training", 1))


def test_a_link_to_a_file_is_read(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"text")
    (tmp_path / "link").symlink_to("file")
    assert read_file(tmp_path / "link") == b"text"
