"""The mutation score in docs/results.md is that of the committed matrix, which is about claims that exist."""

from __future__ import annotations

from pathlib import Path

from evoclaims.mutants import mutant
from evoclaims.verdicts import history, mutation_matrix
from evoclaims.verdicts.mutation_matrix import score
from reproductions.nisioti2025 import REPRODUCTION

ROOT = Path(__file__).parents[2]
MATRIX = mutation_matrix.load(REPRODUCTION.folder / mutation_matrix.FILE)


def test_the_results_quote_the_mutation_score_of_the_committed_matrix() -> None:
    results = " ".join((ROOT / "docs" / "results.md").read_text(encoding="utf-8").split())
    assert score(MATRIX, "smoke") in results, "quote this sentence in docs/results.md"


def test_the_committed_matrix_is_about_accepted_verdicts_and_known_mutants() -> None:
    accepted = history.load(REPRODUCTION.folder / history.FILE)
    assert MATRIX.keys() <= accepted.keys()
    tried = {attempt.mutant for row in MATRIX.values() for attempt in row.attempts}
    assert tried <= mutant.load(REPRODUCTION).keys()


def test_the_committed_matrix_is_of_the_verdicts_that_are_accepted_now() -> None:
    """A claim that is judged otherwise than when its faults were tried counts as not tried in a run."""
    latest = {key: entries[-1] for key, entries in history.load(REPRODUCTION.folder / history.FILE).items()}
    tried = {key: (row.fingerprint, row.outcome) for key, row in MATRIX.items()}
    assert tried == {key: (latest[key].fingerprint, latest[key].outcome) for key in MATRIX}, "run `evoclaims mutants`"
