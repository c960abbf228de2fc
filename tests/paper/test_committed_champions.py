"""Champions that are committed beside their reference trials, and what commands do with them in a fresh clone."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

import pytest

from evoclaims.cli import main
from evoclaims.core.errors import UserError
from evoclaims.paper import references
from reproductions.nisioti2025 import REPRODUCTION

ROOT = Path(__file__).parents[2]
CHAMPIONS = sorted(REPRODUCTION.references.rglob("champions/*.npz"))


def test_each_committed_champion_is_that_of_a_reference_trial() -> None:
    named = {
        trial.champion for file in REPRODUCTION.references.rglob("*-stones*.jsonl") for trial in references.load(file)
    }
    assert len(CHAMPIONS) >= 73
    for path in CHAMPIONS:
        assert hashlib.sha256(path.read_bytes()).hexdigest() == path.stem
        assert path.stem in named


def test_a_fresh_clone_shows_what_a_committed_champion_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(ROOT)
    (tmp_path / "store").mkdir()
    look = ["look", "stones", "--method=neat", f"--storage={tmp_path}/store", f"--out={tmp_path}/path.svg"]
    assert main(look) == 0
    assert "neat on stones (smoke)" in capsys.readouterr().out
    assert (tmp_path / "path.svg").read_bytes().count(b"<path") > 10
    assert main([*look, "--seed=77"]) != 0
    assert "with seed 77, and no champion of it is committed." in capsys.readouterr().err


def test_another_file_than_the_records_champion_is_refused(tmp_path: Path) -> None:
    (trial, *_) = references.committed(REPRODUCTION.references, "smoke", "neat", "stones")
    path = references.champion_path(tmp_path, "smoke", trial)
    assert references.champion_of(tmp_path, "smoke", trial) is None
    path.parent.mkdir(parents=True)
    whole = references.champion_path(REPRODUCTION.references, "smoke", trial).read_bytes()
    path.write_bytes(whole)
    assert references.champion_of(tmp_path, "smoke", trial)
    path.write_bytes(whole[:-1])
    with pytest.raises(UserError, match="is not the champion that its trial's record names"):
        references.champion_of(tmp_path, "smoke", trial)
    torn = replace(trial, champion=hashlib.sha256(b"torn").hexdigest())
    references.champion_path(tmp_path, "smoke", torn).write_bytes(b"torn")
    with pytest.raises(UserError, match="is not a readable npz file"):
        references.champion_of(tmp_path, "smoke", torn)
    path.unlink()
    path.symlink_to(tmp_path / "nowhere")
    with pytest.raises(UserError, match="cannot be read: "):
        references.champion_of(tmp_path, "smoke", trial)
