"""`evoclaims reference` commits stored trials, and says what it leaves alone and what it replaces."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import pytest
from tiny_project import Evoclaims, Project, forget, trials_of

from evoclaims.judging.design import SEQUENTIAL
from evoclaims.paper import references
from evoclaims.paper.reproduction import Reproduction
from evoclaims.trials.store import Store


def test_reference_commits_the_trials_of_every_condition_that_has_enough(evoclaims: Evoclaims) -> None:
    evoclaims("run", "right")
    evoclaims("run", "wrong", "--trials", "9")
    status, out, _ = evoclaims("reference", "--unknown-revision")
    path = references.path_of(Path.cwd() / "reference", "smoke", "right", "parity")
    assert status == 0
    assert f"wrote {path}: 10 trials" in out
    assert "left alone: wrong on parity: 9 of 10 trials are stored or committed" in out
    assert [trial.seed for trial in references.load(path)] == list(range(10))
    assert not references.path_of(Path.cwd() / "reference", "smoke", "wrong", "parity").exists()


def test_trials_of_null_agents_are_committed_too(evoclaims: Evoclaims, project: Project) -> None:
    paper = project.path / "tiny_paper.py"
    agents = "NullAgent('a toss', method='coin'), NullAgent('nobody', method='absent')"
    more = f"from evoclaims.paper.reproduction import NullAgent\nAGENTS = dict(enumerate([{agents}]))\n"
    paper.write_text(f"{paper.read_text()}\n{more}REPRODUCTION = replace(REPRODUCTION, null_agents=AGENTS)\n")
    evoclaims("run", "coin")
    assert evoclaims("reference", "--unknown-revision")[0] == 0
    assert [path.name for path in Path("reference/smoke").iterdir()] == ["coin-parity.jsonl"]


def test_reference_takes_the_trials_of_a_look_and_never_fewer_than_are_committed(
    evoclaims: Evoclaims, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = Reproduction.tier
    monkeypatch.setattr(Reproduction, "tier", lambda self, *names: replace(plain(self, *names), design=SEQUENTIAL))
    evoclaims("run", "right", "--trials", "6")
    evoclaims("run", "wrong", "--trials", "4")
    status, out, _ = evoclaims("reference", "--unknown-revision")
    path = references.path_of(Path.cwd() / "reference", "smoke", "right", "parity")
    assert status == 0
    assert f"wrote {path}: 5 trials\n" in out
    assert "\n  left alone of those stored: 1, made with other versions" in out
    assert "left alone: wrong on parity: 4 of 5 trials are stored or committed" in out
    evoclaims("run", "right")
    assert f"wrote {path}: 10 trials" in evoclaims("reference", "--unknown-revision")[1]
    before = [(trial.seed, trial.digest) for trial in references.load(path)]
    assert len(before) == 10
    evoclaims("run", "right", "--trials", "6", "--storage", "other")
    assert f"wrote {path}: 10 trials" in evoclaims("reference", "--unknown-revision", "--storage", "other")[1]
    assert [(trial.seed, trial.digest) for trial in references.load(path)] == before


def test_stored_trials_join_those_that_are_committed(evoclaims: Evoclaims, monkeypatch: pytest.MonkeyPatch) -> None:
    plain = Reproduction.tier
    monkeypatch.setattr(Reproduction, "tier", lambda self, *names: replace(plain(self, *names), design=SEQUENTIAL))
    evoclaims("run", "right", "--trials", "5")
    evoclaims("reference", "--unknown-revision")
    evoclaims("run", "right", "--trials", "4", "--first-seed", "5", "--storage", "later")
    out = evoclaims("reference", "--unknown-revision", "--storage", "later")[1]
    path = references.path_of(Path.cwd() / "reference", "smoke", "right", "parity")
    assert f"wrote {path}: 5 trials" in out
    evoclaims("run", "right", "--trials", "5", "--first-seed", "5", "--storage", "later")
    assert f"wrote {path}: 10 trials" in evoclaims("reference", "--unknown-revision", "--storage", "later")[1]
    assert [trial.seed for trial in references.load(path)] == list(range(10))
    evoclaims("run", "wrong", "--trials", "4", "--storage", "few")
    status, _, err = evoclaims("reference", "--unknown-revision", "--storage", "few")
    assert (status, "No condition of the smoke tier has 5 stored trials" in err) == (2, True)


def test_reference_says_which_claim_it_cannot_write_the_trials_of(evoclaims: Evoclaims, stored: Store) -> None:
    record = stored.record_files(trials_of(stored, "hand_built_negated")[3].id)[-1]
    record.write_bytes(record.read_bytes()[:50])
    status, out, _ = evoclaims("reference", "--unknown-revision")
    assert status == 0
    assert f"left alone: what b alone reads, which is error now: Cannot use {record.absolute()}: " in out
    assert [path.name for path in Path("reference/smoke").iterdir()] == ["right-parity.jsonl"]


def test_committed_trials_of_another_revision_are_replaced_and_that_is_said(
    evoclaims: Evoclaims, project: Project
) -> None:
    project.write(a="undecided")
    evoclaims("run", "coin")
    (wrote,) = [line for line in evoclaims("reference", "--unknown-revision")[1].splitlines() if "coin" in line]
    assert wrote.endswith("10 trials")
    paper = Path("tiny_paper.py")
    text = paper.read_text(encoding="utf-8")
    paper.write_text(text.replace("revision: ClassVar[int] = 1", "revision: ClassVar[int] = 2"), encoding="utf-8")
    sys.modules.pop("tiny_paper")
    evoclaims("run", "coin")
    (wrote,) = [line for line in evoclaims("reference", "--unknown-revision")[1].splitlines() if "coin" in line]
    assert wrote.endswith(
        "10 trials, in place of 10 of another condition (its settings, budget or revision were others)"
    )


def test_trials_of_unknown_code_are_refused_unless_asked_for(evoclaims: Evoclaims, stored: Store) -> None:
    """What ran before a project's first commit is code that nobody can run again."""
    for method, sha in {"hand_built": "0" * 40, "hand_built_negated": None}.items():
        for trial in trials_of(stored, method):
            git = {"git": {"sha": sha, "dirty": sha is not None and trial.seed < 3}}
            forget(stored, [trial])
            stored.put(replace(trial, provenance={**trial.provenance, **git}, champion=""), {})
    status, out, err = evoclaims("reference")
    assert status == 2
    assert "right-parity" in out
    assert "\n  3 of them ran code with uncommitted changes: " in out
    assert "wrong-parity" not in out
    assert "Trials of wrong on parity ran code of an unknown revision" in err
    assert "wrong-parity.jsonl: 10 trials" in evoclaims("reference", "--unknown-revision")[1]


def test_champions_are_committed_when_asked_for(evoclaims: Evoclaims, monkeypatch: pytest.MonkeyPatch) -> None:
    """The hand-built network of this project has none, so that the store's answers are given."""
    monkeypatch.setattr(Store, "has_champion", lambda self, trial: trial.seed == 3)
    monkeypatch.setattr(Store, "packed_champion", lambda self, trial: b"packed")
    evoclaims("run", "right")
    folder = Path("reference/smoke/champions")
    evoclaims("reference", "--unknown-revision")
    assert not folder.exists()
    evoclaims("reference", "--unknown-revision", "--champions")
    (path,) = folder.iterdir()
    assert path.read_bytes() == b"packed"
