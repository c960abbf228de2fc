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


def as_pipe(path: Path) -> None:
    os.mkfifo(path)


def as_folder(path: Path) -> None:
    path.mkdir()


def as_circle(path: Path) -> None:
    path.symlink_to(path.name)


def as_link_to_nowhere(path: Path) -> None:
    path.symlink_to("nowhere")


ODD: list[Callable[[Path], None]] = [as_pipe, as_folder, as_circle]


@pytest.mark.parametrize("make", ODD)
def test_an_odd_record_is_a_damaged_file_that_verify_moves_aside(
    store: Store, trial: TrialResult, make: Callable[[Path], None]
) -> None:
    path = store.record_path(trial.id)
    path.unlink()
    make(path)
    with pytest.raises(DamagedFileError, match="it cannot be read"):
        store.get(trial.id)
    assert path in {problem.path for problem in verify(store, repair=True)}
    assert store.get(trial.id) is None


@pytest.mark.parametrize("make", [*ODD, as_link_to_nowhere])
def test_an_odd_champion_is_a_damaged_file_that_verify_moves_aside(
    store: Store, trial: TrialResult, make: Callable[[Path], None]
) -> None:
    path = store.champion_path(trial.id)
    path.unlink()
    make(path)
    with pytest.raises(DamagedFileError, match="it cannot be read"):
        store.champion_of(store.get(trial.id))
    assert store.record_path(trial.id) in {problem.path for problem in verify(store, repair=True)}


@pytest.mark.parametrize("make", ODD)
def test_an_odd_checkpoint_is_a_damaged_file(store: Store, make: Callable[[Path], None]) -> None:
    path = store.checkpoints / f"{'a' * 64}-{'b' * 16}.npz"
    path.parent.mkdir(parents=True)
    make(path)
    with pytest.raises(DamagedFileError, match="not a (file|readable checkpoint)"):
        checkpoint.find(store.checkpoints, "a" * 64, "platform")


def test_a_checkpoint_that_leads_nowhere_is_gone(store: Store) -> None:
    path = store.checkpoints / f"{'a' * 64}-{'b' * 16}.npz"
    path.parent.mkdir(parents=True)
    as_link_to_nowhere(path)
    assert not list(checkpoint.find(store.checkpoints, "a" * 64, "platform"))


@pytest.mark.parametrize("make", [*ODD, as_link_to_nowhere])
def test_an_odd_file_of_reference_trials_is_a_sentence(tmp_path: Path, make: Callable[[Path], None]) -> None:
    path = tmp_path / "better-small.jsonl"
    make(path)
    with pytest.raises(UserError, match=r"The reference trials .*better-small\.jsonl .*Restore the file"):
        references.load(path)


@pytest.mark.parametrize("make", ODD)
def test_an_odd_file_of_accepted_verdicts_is_a_sentence(tmp_path: Path, make: Callable[[Path], None]) -> None:
    make(tmp_path / history.FILE)
    with pytest.raises(UserError, match="Cannot read"):
        history.load(tmp_path / history.FILE)


def as_endless_device(path: Path) -> None:
    path.symlink_to("/dev/zero")


def as_brackets(path: Path) -> None:
    path.write_text("[" * 200_000 + "]" * 200_000)


@pytest.mark.parametrize("make", [*ODD, as_link_to_nowhere, as_endless_device, as_brackets])
def test_an_odd_file_of_evidence_is_replaced(tmp_path: Path, make: Callable[[Path], None]) -> None:
    report = ClaimReport("A", "", "smoke", "it is", "§1", Outcome.SUPPORTED, "so it is")
    path = evidence_path(report, tmp_path)
    path.parent.mkdir(parents=True)
    make(path)
    saved = save(report, tmp_path)
    assert bool(saved.unsaved) == (make is as_folder)
    if make is not as_folder:
        assert ClaimReport.from_json(json.loads(path.read_text())) == saved


@pytest.mark.parametrize("make", [*ODD, as_link_to_nowhere, as_endless_device])
def test_an_odd_log_of_a_job_has_no_last_words(tmp_path: Path, make: Callable[[Path], None]) -> None:
    make(tmp_path / "1_0_log.out")
    assert last_words(tmp_path / "1_0_log.out") == ""


@pytest.mark.parametrize("make", [*ODD, as_endless_device])
def test_odd_files_of_settings_and_numbers_are_a_sentence(tmp_path: Path, make: Callable[[Path], None]) -> None:
    make(tmp_path / "pyproject.toml")
    with pytest.raises(UserError, match="Cannot read"):
        load_config(tmp_path)
    with pytest.raises(UserError, match="Cannot read"):
        load_published(tmp_path / "pyproject.toml")


def test_a_pipe_where_progress_is_shared_keeps_nobody_waiting(tmp_path: Path) -> None:
    path = progress_path(tmp_path, "a" * 64)
    path.parent.mkdir(parents=True)
    as_pipe(path)
    with shared(tmp_path, "a" * 64, ignore) as tell:
        tell(RunProgress("a on b", "training", 1))


def test_reference_trials_of_a_name_that_no_file_can_have_are_not_there(tmp_path: Path) -> None:
    assert references.load(references.path_of(tmp_path, "smoke", "m" * 300, "task")) == ()


def test_a_link_to_a_file_is_read(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"text")
    (tmp_path / "link").symlink_to("file")
    assert read_file(tmp_path / "link") == b"text"
