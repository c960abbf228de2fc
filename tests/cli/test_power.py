"""`evoclaims power`: how often claims end as expected, from a pilot that is run, written, committed and read again."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from tiny_project import Evoclaims, Project

from evoclaims.judging.design import SEQUENTIAL
from evoclaims.paper.reproduction import Reproduction
from evoclaims.trials.spec import Condition
from evoclaims.trials.store import Store

MAKE = ("power", "--trials=12")
FEW = ("power", "--draws=50")
"""As many draws as it takes where no interval is read."""
PILOT = Path("pilot/smoke")
HALF = "verdict(trials('coin', on='parity').solves_every_level.in_most_trials())"


@pytest.fixture
def piloted(evoclaims: Evoclaims, stored: Store, kept: Path) -> Evoclaims:
    """The project with pilots of the right and the wrong network, and the store that they were run in."""
    if not (kept / "pilot").exists():
        assert evoclaims(*MAKE, "--run", "--draws=10")[0] == 1
        shutil.copytree("pilot", kept / "pilot")
        shutil.copytree(".evoclaims", kept / "store")
    else:
        shutil.copytree(kept / "pilot", "pilot")
        shutil.rmtree(".evoclaims")
        shutil.copytree(kept / "store", ".evoclaims")
    return evoclaims


def rows(out: str) -> dict[str, list[str]]:
    """Return the cells of each claim's row, without those that hold nothing but space."""
    return {words[0]: words[1:] for line in out.splitlines() if (words := line.split())}


def test_without_a_pilot_it_says_how_to_make_one(evoclaims: Evoclaims) -> None:
    status, out, err = evoclaims("power")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "a: no pilot of right on parity (it has not been made)" in err
    assert "`evoclaims power --run`" in err
    assert "`evoclaims power --only 'a, b' --run`" in evoclaims("power", "--only", "a, b")[2]


def test_a_pilot_is_run_once_and_read_ever_after(piloted: Evoclaims, stored: Store) -> None:
    seeds = {trial.seed for trial in stored.results([])}
    assert seeds == {*range(10), *range(100, 112)}
    assert sorted(path.name for path in PILOT.iterdir()) == ["right-parity.jsonl", "wrong-parity.jsonl"]
    shutil.rmtree(".evoclaims")
    status, out, _ = piloted("power")
    assert status == 1  # b, which is refuted and not accepted, is expected to be supported
    found = rows(out)
    assert found["a"] == ["supported", "1.000", "0.996–1.000", "1.000", "0.000", "0.000", "0.000", "0.000", "9"]
    assert found["b"][:3] == ["supported", "0.000", "below"]
    assert found["b"][4:] == ["0.000", "1.000", "0.000", "0.000", "1.000", ">", "12"]
    assert "Of 2 verdicts of a run, 1 end otherwise than expected on average, 1 of them the other way." in out
    assert piloted("power") == (status, out, "")
    assert not Path(".evoclaims").exists()
    before = {path: path.read_bytes() for path in PILOT.iterdir()}
    assert piloted(*MAKE, "--run")[1] == out  # nothing is missing: nothing is run
    assert {path: path.read_bytes() for path in PILOT.iterdir()} == before
    assert not Path(".evoclaims").exists()


def test_a_second_pilot_has_other_seeds_and_power_is_read_from_it_alone(piloted: Evoclaims, stored: Store) -> None:
    assert "from its first pilot" in piloted(*FEW)[1]
    first = {path: path.read_bytes() for path in PILOT.iterdir()}
    status, out, err = piloted(*MAKE, "--pilot=second", "--first-seed=105", "--run")
    assert (status, out) == (2, "")
    assert "The seeds 105 to 116 overlap those of the other pilot (105 to 111)" in err
    status, out, _ = piloted(*MAKE, "--draws=50", "--pilot=second", "--run", "--only=a")
    assert (status, out.count("wrote"), "from its second pilot" in out) == (0, 1, True)
    assert {trial.seed for trial in stored.results([])} == {*range(10), *range(100, 112), *range(150, 162)}
    assert {path: path.read_bytes() for path in PILOT.iterdir()} == first
    status, out, err = piloted(*FEW)
    assert (status, rows(out)["a"][1], rows(out)["b"][1]) == (1, "1.000", "unknown")
    assert "b: no pilot of wrong on parity (it has not been made)" in out
    assert piloted(*FEW, "--pilot=first")[1].count("unknown") == 0
    shutil.copy(PILOT / "right-parity.jsonl", "second_pilot/smoke/right-parity.jsonl")
    assert "a: no pilot of right on parity (it has seeds of the first pilot (100, 101, " in piloted(*FEW, "--only=a")[2]


def test_a_refutation_is_what_an_accepted_claim_is_expected_to_end_as(piloted: Evoclaims, project: Project) -> None:
    project.write(
        """
@says("b", expect=Outcome.REFUTED, because="it is wrong")
def test_b(trials, verdict):
    verdict(trials("wrong", on="parity").solves_every_level.in_most_trials())

@claim("c", says="c", where="§1", smoke=None, because="too small")
def test_c(trials, verdict):
    verdict(trials("coin", on="parity").solves_every_level.in_most_trials())
"""
    )
    status, out, err = piloted("power")
    assert (status, err, set(rows(out)) & {"b", "c"}) == (0, "", {"b"})
    assert rows(out)["b"][:3] == ["refuted", "1.000", "0.996–1.000"]


def test_claims_can_be_chosen_and_only_their_pilots_are_needed(piloted: Evoclaims, project: Project) -> None:
    project.write(a="supported", c=HALF)
    status, out, err = piloted(*FEW)
    assert status == 1
    assert "c: no pilot of coin on parity (it has not been made)" in out
    assert "`evoclaims power --run` runs and writes the pilots that are missing." in err
    assert (rows(out)["a"][1], rows(out)["c"][1]) == ("1.000", "unknown")
    assert (piloted(*FEW, "--only=a")[0], piloted(*FEW, "--only=a,c")[0]) == (0, 1)
    status, _, err = piloted(*FEW, "--only=d")
    assert (status, "There is no claim named 'd'." in err) == (2, True)
    status, out, _ = piloted(*MAKE, "--draws=50", "--run", "--only=c")
    assert (status, out.count("wrote")) == (1, 1)
    assert "coin-parity.jsonl: 12 trials" in out
    assert rows(out)["c"][2] == "below"
    assert 0.0 < float(rows(out)["c"][7]) < 1.0  # some draws are inconclusive


def test_a_pilot_of_another_condition_is_refused_and_made_anew(piloted: Evoclaims) -> None:
    right = PILOT / "right-parity.jsonl"
    before = right.read_bytes()
    shutil.copy(PILOT / "wrong-parity.jsonl", right)
    status, out, _ = piloted(*FEW)
    assert status == 1
    assert (
        "a: no pilot of right on parity (it is of another condition, since method, task or budget have changed)" in out
    )
    assert "wrote" in piloted(*MAKE, "--draws=50", "--stored")[1]
    assert right.read_bytes() == before


def test_trials_that_have_not_run_are_not_written(piloted: Evoclaims) -> None:
    shutil.rmtree(PILOT)
    status, out, err = piloted(*FEW, "--trials=13", "--stored")
    assert (status, err.count("\n"), PILOT.exists()) == (2, 1, False)
    assert "left alone: right on parity: 12 of 13 trials are stored, counted from seed 100" in out
    assert piloted(*FEW, "--trials=13", "--first-seed=200", "--stored")[:2] == (2, "")


def test_a_pilot_of_code_that_was_edited_is_said(piloted: Evoclaims, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Condition, "edited_since", lambda self, trials: ("its.Network",))
    said = "right on parity: the code of its.Network was edited or renamed after trials had run"
    assert said in piloted(*FEW)[1]


def test_a_condition_that_breaks_does_not_stop_the_others(piloted: Evoclaims, project: Project) -> None:
    shutil.rmtree(PILOT)
    project.write(a="supported", d="error")
    status, out, err = piloted(*MAKE, "--draws=50", "--run")
    assert (status, rows(out)["a"][1]) == (1, "1.000")
    assert "broken on parity (smoke) failed: RuntimeError: out of order" in err
    assert "d: no pilot of broken on parity" in out


def test_a_pilot_has_no_seeds_of_a_third_look(evoclaims: Evoclaims, monkeypatch: pytest.MonkeyPatch) -> None:
    plain = Reproduction.tier
    monkeypatch.setattr(Reproduction, "tier", lambda self, *names: replace(plain(self, *names), design=SEQUENTIAL))
    status, _, err = evoclaims("power", "--run", "--first-seed=10")
    assert status == 2
    assert "The seeds 10 to 59 overlap the smoke tier's own (0 to 29)" in err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--run", "--first-seed=5"), "The seeds 5 to 54 overlap the smoke tier's own (0 to 9)"),
        (("--run", "--trials=9"), "--trials takes 10 (as many as a verdict reads) to 100 trials per condition, not 9."),
        (("--stored", "--trials=101"), "to 100 trials per condition, not 101."),
        (("--run", "--first-seed=2147483647"), "A seed is a whole number from 0 to 2147483647"),
        (("--draws=0",), "--draws takes a number from 1 up, not 0."),
    ],
)
def test_a_mistake_is_a_sentence(evoclaims: Evoclaims, arguments: tuple[str, ...], said: str) -> None:
    status, _, err = evoclaims("power", *arguments)
    assert (status, err.count("\n"), PILOT.exists()) == (2, 1, False)
    assert said in err
