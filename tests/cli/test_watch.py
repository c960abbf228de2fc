"""`evoclaims watch` in the tiny project: fresh seeds each night, one entry a night, an alarm, and a kill in between."""

from __future__ import annotations

import re
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from tiny_project import BODIES, Evoclaims, Project, aged, spoiled, trials_of

from evoclaims.paper import references
from evoclaims.trials.result import TrialResult, digest
from evoclaims.trials.store import Store
from evoclaims.verdicts import watch_file
from evoclaims.verdicts.watch_file import load

FILE = Path("watch.toml")
COMMITTED = Path("reference/smoke/right-parity.jsonl")


@pytest.fixture
def watching(evoclaims: Evoclaims, stored: Store, kept: Path) -> Evoclaims:
    """The project with committed trials of the right and the wrong network, and a store with the first night's."""
    for method in ("right", "wrong"):
        references.write(COMMITTED.with_name(f"{method}-parity.jsonl"), trials_of(stored, method_name(method)))
    if (kept / "store").exists():
        shutil.rmtree(stored.root)
        shutil.copytree(kept / "store", stored.root)
        shutil.copy(kept / FILE, FILE)
    else:
        status, out, err = evoclaims("watch")
        assert (status, err) == (0, "")
        assert "Night 1 of series 1 (smoke): seeds 10000 to 10029 of 2 conditions." in out
        assert "Alarm at an evidence of 60 (3 families / α 0.05)." in out
        assert "No alarm. Next: commit watch.toml; the next night goes on with seed 10030." in out
        shutil.copytree(stored.root, kept / "store")
        shutil.copy(FILE, kept)
    return evoclaims


def method_name(method: str) -> str:
    return {"right": "hand_built", "wrong": "hand_built_negated"}[method]


def resealed(trial: TrialResult) -> TrialResult:
    """Return an edited trial with the digest of what it has now."""
    return replace(trial, digest=digest("done", trial.metrics, trial.levels, trial.curves, b""), champion="")


def seeds(store: Store) -> list[int]:
    return sorted(trial.seed for trial in trials_of(store, "hand_built"))


def test_each_night_adds_an_entry_of_fresh_seeds(watching: Evoclaims, stored: Store) -> None:
    before = FILE.read_bytes()
    assert watching("watch", "--trials=3")[0] == 0
    assert FILE.read_bytes().startswith(before)
    first, second = load(FILE)[1]
    assert (first.seeds, second.seeds) == (tuple(range(10_000, 10_030)), (10_030, 10_031, 10_032))
    assert seeds(stored) == [*range(10), *range(10_000, 10_033)]
    assert first.values["right on parity"]["mean_success"] == (1.0,) * 30
    assert 0 < second.evidence["right"] < first.evidence["right"] < 1
    assert {"jax", "numpy"} <= second.versions.keys()


def test_no_night_has_seeds_of_the_design(watching: Evoclaims) -> None:
    FILE.unlink()
    paper = Path("tiny_paper.py")
    design = "Design(looks=Design.fixed(10).looks, first_seed=9_991)"  # up to seed 10,000
    paper.write_text(paper.read_text(encoding="utf-8").replace("Design.fixed(10)", design, 1), encoding="utf-8")
    sys.modules.pop("tiny_paper", None)
    assert watching("watch", "--trials=2")[0] == 0
    assert load(FILE)[1][0].seeds == (10_001, 10_002)


def test_a_kill_in_a_night_repeats_nothing_and_counts_nothing_twice(
    watching: Evoclaims, stored: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = FILE.read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr(watch_file, "append", interrupt)
        status, _, err = watching("watch")
    assert (status, "the same command goes on from the last checkpoint" in err) == (130, True)
    assert FILE.read_bytes() == before
    ran = {trial.id: trial.timing for trial in stored.results([])}
    assert len(ran) == 140
    assert watching("watch")[0] == 0
    assert {trial.id: trial.timing for trial in stored.results([])} == ran
    assert seeds(stored) == [*range(10), *range(10_000, 10_060)]
    assert [night.seeds[0] for night in load(FILE)[1]] == [10_000, 10_030]


def test_trials_of_a_killed_night_do_not_count_once_their_code_is_edited(
    evoclaims: Evoclaims, project: Project, stored: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    project.write(a="undecided")
    assert evoclaims("run", "coin")[0] == 0
    references.write(COMMITTED.with_name("coin-parity.jsonl"), trials_of(stored, "coin"))
    with monkeypatch.context() as patch:
        patch.setattr(watch_file, "append", interrupt)
        assert evoclaims("watch", "--trials=3")[0] == 130
    paper = Path("tiny_paper.py")
    paper.write_text(paper.read_text(encoding="utf-8").replace("1.0, -1.0)", "2.0, -2.0)"), encoding="utf-8")
    sys.modules.pop("tiny_paper", None)
    status, out, _ = evoclaims("watch", "--trials=2")
    assert status == 0
    assert "Trials up to seed 10001 ran before tiny_paper.Coin was edited or renamed: they do not count" in out
    assert "Trials up to seed 10002 ran before tiny_paper.Coin was edited" in out
    assert "Edited or renamed since the committed trials: tiny_paper.Coin. A change may come of that" in out
    assert "seeds 10003 to 10004 of 1 condition.\nAlarm at an evidence of 20 (1 family / α 0.05)." in out
    assert [night.seeds for night in load(FILE)[1]] == [(10_003, 10_004)]


def interrupt(*_: object) -> None:
    raise KeyboardInterrupt


def test_an_alarm_ends_with_1_until_a_new_series_begins(watching: Evoclaims, stored: Store) -> None:
    """The committed trials solved nothing, with another numpy: so the night's trials have changed."""
    sound = COMMITTED.read_bytes()
    references.write(COMMITTED, [aged(spoiled(trial)) for trial in references.load(COMMITTED)])
    status, out, _ = watching("watch", "--as=markdown", "--out=issue.md")
    assert status == 1
    assert "A new series: earlier nights do not count" in out
    assert "ALARM on " in out
    assert "moved: right on parity: mean_success is higher: median 0 -> 1, A12 = 1.00" in out
    assert re.search(r"versions against the committed trials: numpy 1\.0 -> \S+ since night 1\n", out)
    text = Path("issue.md").read_text(encoding="utf-8")
    assert text.startswith("# Trials have changed: ")
    assert "mean\\_success is higher" in text
    assert watching("watch", "--trials=3")[0] == 1
    COMMITTED.write_bytes(sound)  # which begins a series, as the edit of any claim may
    status, out, _ = watching("watch", "--trials=3")
    assert status == 1
    assert re.search(r"The alarm of series 2 \(right.*\) stays until a night is run with --restart\.\nALARM on ", out)
    assert "moved: right on parity: mean_success is higher" in out
    assert "No alarm" not in out
    assert watching("watch", "--restart", "--trials=3")[0] == 0
    assert watching("watch", "--trials=3")[0] == 0
    assert [(night.series, night.restart) for night in load(FILE)[1]] == [
        *((1, False), (2, False), (2, False), (3, False), (4, True), (4, False))
    ]


def test_what_cannot_be_watched_is_said_before_anything_runs(watching: Evoclaims, stored: Store) -> None:
    before = sorted(stored.ids())
    shutil.copy(FILE, "sound.toml")
    FILE.write_text(FILE.read_text(encoding="utf-8").replace("1.0", "0.0", 1), encoding="utf-8")
    assert_refused(watching, "watch.toml is not as `evoclaims watch` wrote it: night 1 does not match its seal")
    shutil.copy("sound.toml", FILE)
    assert_refused(watching, "--trials takes 1 to", "--trials=0")
    assert_refused(watching, "form", "--as=csv")
    shutil.rmtree("reference")
    assert_refused(watching, "no condition of the smoke tier's claims has ten committed trials")
    assert sorted(stored.ids()) == before


@pytest.mark.parametrize("seed", [0, 3])
def test_a_measure_that_one_committed_trial_lacks_is_said(watching: Evoclaims, project: Project, seed: int) -> None:
    project.write(a="verdict(trials('right', on='parity').measure('smoothness') > 1.0)")
    trials = [replace(trial, metrics={**trial.metrics, "smoothness": 2.0}) for trial in references.load(COMMITTED)]
    trials[seed].metrics.pop("smoothness")
    references.write(COMMITTED, [resealed(trial) for trial in trials])
    status, out, _ = watching("watch", "--trials=3")
    assert status == 0
    assert f"Not watched, since some reference trials lack it: right on parity: smoothness (seed {seed}).\n" in out
    assert "smoothness" not in load(FILE)[1][-1].values["right on parity"]


def test_a_broken_claim_takes_no_condition_from_the_watch(watching: Evoclaims, project: Project, stored: Store) -> None:
    before = sorted(stored.ids())
    project.write(a="supported", b="import gone")
    assert_refused(
        watching, "1 broken claim of the smoke tier would read: b (ModuleNotFoundError: No module named 'gone'"
    )
    project.write(a="supported", b=BODIES["refuted"] + "\n    raise OSError", c="pass")
    assert_refused(watching, "2 broken claims of the smoke tier would read: b (OSError")
    assert sorted(stored.ids()) == before


def test_a_condition_that_no_claim_reads_any_longer_is_said_until_a_series_begins(
    watching: Evoclaims, project: Project
) -> None:
    """A claim may be skipped with some release: its condition must not leave the watch unseen."""
    project.write(a="supported", b="pytest.skip('not with this release')")
    said = "No longer watched, since no claim reads it: wrong on parity."
    assert [said in watching("watch", "--trials=2", *more)[1] for more in ((), (), ("--restart",))] == [
        *(True, True, False)
    ]


def assert_refused(watching: Evoclaims, says: str, *options: str) -> None:
    status, out, err = watching("watch", *options)
    assert (status, out) == (2, "")
    assert says in err


def test_a_condition_that_fails_keeps_the_night_from_counting(
    watching: Evoclaims, monkeypatch: pytest.MonkeyPatch
) -> None:
    from evoclaims.methods.hand_built import HandBuilt

    before = FILE.read_bytes()
    monkeypatch.setattr(HandBuilt, "best", fail)
    status, _, err = watching("watch", "--trials=2")
    assert status == 2
    assert "conditions failed (above), so this night is not added" in err
    assert FILE.read_bytes() == before


def fail(*_: object) -> None:
    raise RuntimeError("out of order")
