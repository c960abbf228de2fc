"""The matrix of claims and mutants: fates, scores, and the file."""

from __future__ import annotations

from pathlib import Path

import pytest

from evoclaims.core.errors import UserError
from evoclaims.judging.verdict import Outcome
from evoclaims.verdicts.mutation_matrix import Attempt, Fate, Matrix, Sensitivity, dump, fate, load, score

SUPPORTED, REFUTED = Outcome.SUPPORTED, Outcome.REFUTED


@pytest.mark.parametrize("sound", [SUPPORTED, REFUTED, Outcome.INCONCLUSIVE])
@pytest.mark.parametrize("faulty", list(Outcome))
@pytest.mark.parametrize("drifted", [False, True])
def test_a_mutant_is_killed_where_the_outcome_differs_and_only_there(
    sound: Outcome, faulty: Outcome, drifted: bool
) -> None:
    became = fate(sound, faulty, equivalent=False, drifted=drifted)
    if faulty in (Outcome.ERROR, Outcome.NOT_RUN):
        assert became is Fate.BROKEN
    elif faulty is sound:
        assert became is (Fate.DRIFTED if drifted else Fate.SURVIVED)
    else:
        assert became is Fate.KILLED
    assert fate(sound, faulty, equivalent=True, drifted=drifted) is Fate.EQUIVALENT


def row(**fates: Fate) -> Sensitivity:
    attempts = tuple(Attempt(name, "neat", REFUTED, one) for name, one in fates.items())
    return Sensitivity(SUPPORTED, "f" * 64, attempts)


def test_a_claim_is_insensitive_when_mutants_were_tried_and_none_has_changed_it() -> None:
    assert row(a=Fate.SURVIVED, b=Fate.DRIFTED).insensitive
    assert not row(a=Fate.SURVIVED, b=Fate.KILLED).insensitive
    assert not row(a=Fate.EQUIVALENT, b=Fate.BROKEN).insensitive
    assert not row().insensitive


def test_a_target_is_unnoticed_when_none_of_its_mutants_has_changed_the_verdict() -> None:
    attempts = (
        Attempt("minimizes", "neat", REFUTED, Fate.KILLED),
        Attempt("minimizes", "ppo", SUPPORTED, Fate.SURVIVED),
    )
    assert Sensitivity(SUPPORTED, "", attempts).unnoticed(("neat", "ppo", "cma_es")) == ("ppo", "cma_es")


MATRIX: Matrix = {
    ("smoke", "A"): row(a=Fate.KILLED, b=Fate.SURVIVED, c=Fate.DRIFTED, d=Fate.EQUIVALENT),
    ("smoke", "B[x]"): row(a=Fate.SURVIVED, c=Fate.SURVIVED),
    ("full", "A"): row(b=Fate.KILLED),
}


def test_the_score_counts_each_mutant_once_by_the_best_that_notices_it() -> None:
    found = score(MATRIX, "smoke")
    assert (found.mutants, found.by_verdict, found.by_drift, found.claims) == (3, 1, 1, 2)
    assert found.insensitive == ("B[x]",)
    assert str(found) == (
        "1 of 3 mutants change a verdict, 1 more are told by the drift check; 1 of 2 claims are changed by none of "
        "those tried"
    )


def test_the_file_gives_back_what_was_written(tmp_path: Path) -> None:
    path = tmp_path / "mutants.toml"
    path.write_text(dump(MATRIX))
    assert load(path) == MATRIX
    assert load(tmp_path / "none.toml") == {}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[", "holds no matrix of mutants"),
        ("schema = 2\n", "reads schema 1"),
        ('schema = 1\n[smoke.A]\noutcome = "fine"\nfingerprint = ""\nattempts = []\n', "'fine'"),
        ('schema = 1\n[smoke.A]\noutcome = "refuted"\n', "fingerprint"),
    ],
)
def test_a_file_that_holds_no_matrix_is_one_sentence(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "mutants.toml"
    path.write_text(text)
    with pytest.raises(UserError, match=said):
        load(path)
