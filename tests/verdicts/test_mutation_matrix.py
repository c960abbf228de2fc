"""The matrix of claims and mutants: fates, scores, and the file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from hand_made_verdicts import report, verdict

from evoclaims.core.errors import UserError
from evoclaims.judging.verdict import Outcome
from evoclaims.verdicts.claim_report import Tried
from evoclaims.verdicts.mutation_matrix import (
    Attempt,
    Fate,
    Matrix,
    Part,
    Sensitivity,
    described,
    dump,
    fate,
    load,
    score,
    tried,
)

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
    # Whatever a claim reads that is not compared.
    of_equal_trials = fate(sound, faulty, equivalent=True, drifted=drifted)
    assert of_equal_trials is (Fate.EQUIVALENT if faulty is sound else became)


def attempt(name: str, fate: Fate, target: str = "neat", part: Part = "method") -> Attempt:
    return Attempt(name, part, target, REFUTED if fate is Fate.KILLED else SUPPORTED, fate)


def row(*attempts: Attempt, untried: tuple[str, ...] = (), **fates: Fate) -> Sensitivity:
    own = tuple(attempt(name, one) for name, one in fates.items())
    return Sensitivity(SUPPORTED, "f" * 64, ("neat",), (*own, *attempts), untried)


BLIND = attempt("blind", Fate.KILLED, "maze", "task")


@pytest.mark.parametrize(
    ("one", "found"),
    [
        (row(a=Fate.SURVIVED, b=Fate.DRIFTED), Tried.INSENSITIVE),
        (row(a=Fate.SURVIVED, b=Fate.KILLED), Tried.SENSITIVE),
        (row(a=Fate.EQUIVALENT, b=Fate.BROKEN), Tried.NOT_TRIED),
        (row(), Tried.NOT_TRIED),
        (row(BLIND, a=Fate.SURVIVED), Tried.INSENSITIVE),  # a fault of its task says nothing about its methods
        (row(BLIND, a=Fate.EQUIVALENT), Tried.SENSITIVE),  # a method that never learns can have no fault
        (row(replace(BLIND, fate=Fate.SURVIVED)), Tried.INSENSITIVE),
        (row(BLIND, untried=("neat: a",)), Tried.NOT_TRIED),
        (row(a=Fate.SURVIVED, untried=("neat: b",)), Tried.NOT_TRIED),
        (row(a=Fate.KILLED, untried=("neat: b",)), Tried.SENSITIVE),
    ],
)
def test_a_claim_is_insensitive_when_no_fault_of_its_methods_changes_it(one: Sensitivity, found: Tried) -> None:
    assert one.tried is found


def test_a_method_is_unnoticed_when_none_of_its_own_mutants_has_changed_the_verdict() -> None:
    own = attempt("minimizes", Fate.KILLED), attempt("minimizes", Fate.SURVIVED, "ppo")
    assert Sensitivity(SUPPORTED, "", ("neat", "ppo", "cma_es"), (*own, BLIND)).unnoticed == ("ppo", "cma_es")


NOT_TRIED = "Planted faults: not tried."


def test_a_row_is_about_a_verdict_of_the_same_conditions_rules_and_outcome_and_no_other() -> None:
    judged = report("A", verdict=verdict(fingerprint="f" * 64))
    matrix = {("smoke", "A"): row(a=Fate.SURVIVED)}
    assert tried(matrix, judged) is Tried.INSENSITIVE
    assert (
        described(matrix, judged) == "Insensitive. Planted faults: 0 of 1 change this verdict, none of those in neat."
    )
    for other in (
        report("A", verdict=verdict(fingerprint="e" * 64)),
        report("A", "refuted", verdict=verdict("refuted", fingerprint="f" * 64)),
        replace(judged, tier="full"),
        replace(judged, variant="sigmoid"),
        report("B", verdict=verdict(fingerprint="f" * 64)),
    ):
        assert tried(matrix, other) is Tried.NOT_TRIED
        assert described(matrix, other) == NOT_TRIED
    assert described({("smoke", "A"): row(a=Fate.KILLED)}, judged) == "Planted faults: 1 of 1 change this verdict."
    assert described({("smoke", "A"): row(untried=("a",))}, judged) == NOT_TRIED
    begun = replace(row(a=Fate.KILLED, untried=("ppo: a",)), methods=("neat", "ppo"))
    assert described({("smoke", "A"): begun}, judged) == "Planted faults: 1 of 1 change this verdict."


MATRIX: Matrix = {
    ("smoke", "A"): row(BLIND, a=Fate.KILLED, b=Fate.SURVIVED, c=Fate.DRIFTED, d=Fate.EQUIVALENT),
    ("smoke", "B[x]"): row(a=Fate.SURVIVED, c=Fate.SURVIVED),
    ("smoke", "C"): replace(row(a=Fate.KILLED), methods=("neat", "ppo")),
    ("smoke", "D"): row(untried=("neat: a",)),
    ("smoke", "E"): replace(row(a=Fate.KILLED, untried=("ppo: a",)), methods=("neat", "ppo")),
    ("full", "A"): row(b=Fate.KILLED),
}


def test_the_score_counts_each_mutant_once_by_the_best_that_notices_it() -> None:
    assert score(MATRIX, "smoke") == (
        "Mutation score (smoke): 2 of 4 planted faults change a verdict, 1 more are found by the drift check; of 4 "
        "claims 1 are insensitive, and 1 notice faults in some of their methods alone."
    )
    assert score(MATRIX, "middle") == "Mutation score (middle): not tried."


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
        ('schema = 1\n[smoke.A]\noutcome = "fine"\nfingerprint = ""\nuntried = []\n', "'fine'"),
        (dump({("smoke", "A"): row(a=Fate.SURVIVED)}).replace('"survived"', '"lived"'), "'lived' is not a valid Fate"),
        ('schema = 1\n[smoke.A]\noutcome = "refuted"\n', "fingerprint"),
    ],
)
def test_a_file_that_holds_no_matrix_is_one_sentence(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "mutants.toml"
    path.write_text(text)
    with pytest.raises(UserError, match=said):
        load(path)
