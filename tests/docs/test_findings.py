"""The tables of docs/findings.md are those that the committed trials give."""

from __future__ import annotations

from importlib.metadata import version

import pytest

from evoclaims.judging.exact import rank_test
from reproductions.nisioti2025 import findings, findings_pictures


def test_the_tables_of_the_findings_are_those_of_the_committed_trials() -> None:
    page = findings.PAGE.read_text(encoding="utf-8")
    assert page.count("<!-- findings: end -->") == 3
    changed = page.replace("| 4.9 (4.8) |", "| 5.9 (4.8) |")
    assert changed != page
    assert findings.filled(changed) == page


def test_fresh_trials_are_of_the_seeds_that_the_rule_names_and_of_their_variants() -> None:
    for path in findings.FRESH.rglob("*.jsonl"):
        variant, (method, task) = path.parts[-3], path.stem.split("-")
        found = findings.trials(variant, method, fresh=True)
        condition = findings.REPRODUCTION.tier("full", variant).condition(method, task)
        assert [trial.seed for trial in found] == list(range(100, 110))
        assert {trial.condition for trial in found} == {condition.id}


def test_no_composite_passes_the_rule_for_a_hit() -> None:
    for variant in findings.COMPOSITES:
        neat, hyperneat, cma_es = (
            [trial.metrics["stones"] for trial in findings.trials(variant, method, fresh=True)]
            for method in ("neat", "hyperneat", "cma_es")
        )
        assert max(hyperneat) < 1.5  # three are published
        assert rank_test(neat, cma_es).p > 0.05 / findings.TRIED


@pytest.mark.oldest
@pytest.mark.parametrize("name", findings_pictures.PICTURES)
def test_the_pictures_of_the_findings_are_drawn_from_the_committed_trials(name: str) -> None:
    committed = (findings.PAGE.parent / f"findings-{name}.svg").read_text(encoding="utf-8")
    if f"Matplotlib v{version('matplotlib')}," not in committed:
        pytest.skip("another release of Matplotlib draws other paths")
    assert findings_pictures.drawn(name).decode() == committed
    assert f"(findings-{name}.svg)" in findings.PAGE.read_text(encoding="utf-8")
