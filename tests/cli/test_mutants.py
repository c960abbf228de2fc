"""`evoclaims mutants`: planted faults, what claims notice of them, and the file that says so."""

from __future__ import annotations

from pathlib import Path

from tiny_project import Evoclaims

from evoclaims.trials.store import Store
from evoclaims.verdicts.mutation_matrix import Fate, load

BLIND = "parity: blind"


def test_a_claim_notices_a_blind_task_and_no_fault_in_what_never_learns(evoclaims: Evoclaims, stored: Store) -> None:
    status, out, err = evoclaims("mutants")
    assert (status, err) == (0, "")
    matrix = load(Path("mutants.toml"))
    right = matrix["smoke", "a"]
    assert BLIND in right.named(Fate.KILLED)
    assert "parity: wrong-row" in right.named(Fate.KILLED)
    assert "right: minimizes" in right.named(Fate.EQUIVALENT)
    assert not right.insensitive
    assert f"{BLIND}" in out
    assert "mutants change a verdict" in out.splitlines()[-2]
    before = len(stored.ids())
    assert evoclaims("mutants", "--mutant=blind")[0] == 0
    assert len(stored.ids()) == before
    assert load(Path("mutants.toml")) == matrix


def test_one_fault_of_one_target_can_be_asked_for(evoclaims: Evoclaims, stored: Store) -> None:
    assert evoclaims("mutants", "--mutant=paralysed", "--of=parity")[0] == 0
    (attempt,) = load(Path("mutants.toml"))["smoke", "a"].attempts
    assert (attempt.mutant, attempt.target) == ("paralysed", "parity")


def test_a_users_mistake_is_one_sentence(evoclaims: Evoclaims, stored: Store) -> None:
    for arguments, said in (
        (("--mutant=blnd",), "There is no mutant named 'blnd'. Did you mean 'blind'?"),
        (("--of=neat",), "There is no method or task named 'neat'."),
        (("--tier=ful",), "There is no tier named 'ful'."),
    ):
        status, _, err = evoclaims("mutants", *arguments)
        assert (status, err.count("\n")) == (2, 1)
        assert said in err


def test_without_verdicts_there_is_nothing_to_change(evoclaims: Evoclaims) -> None:
    status, _, err = evoclaims("mutants")
    assert (status, err.count("\n")) == (2, 1)
    assert "No claim of the smoke tier is judged yet" in err
