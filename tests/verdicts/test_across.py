"""Claims by environments: what changed against the first is told, and only that."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest
from hand_made_verdicts import report
from made_trials import trial_of

from evoclaims.cli.bisect import KINDS, _unchanged
from evoclaims.core.packages import recorded
from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.report import across as across_report
from evoclaims.report.console import PlainSpokenConsole
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Budget, Condition
from evoclaims.trials.store import Store
from evoclaims.verdicts.across import Across, Judged, across, judged
from evoclaims.verdicts.source_trials import SourceTrials
from evoclaims.verdicts.upgrade import Succession, upgrade

CONDITION = Condition(HandBuilt(), NParity(2), "direct", Budget(generations=1, reports=1))
HERE = {"device": {"platform": "cpu", "kind": "cpu"}, "machine": "Linux", "depends_on": ["jax"]}
BY_VERSION: Mapping[str, float] = {"1": 0.5, "2": 0.5, "3": 0.25, "4": 0.5}
"""Success of trials by the version of jax that they were made with; 4 changes their digests alone."""


def _trial(seed: int, version: str) -> TrialResult:
    """Return a trial of a version."""
    made = trial_of(
        CONDITION, seed, BY_VERSION[version] + seed / 100, provenance={**HERE, "versions": {"jax": version}}
    )
    return replace(made, digest="4" * 64) if version == "4" else made


@pytest.fixture
def store(monkeypatch: pytest.MonkeyPatch) -> Store:
    """A store that has every trial in every version."""

    def made_with(self: Store, trial_id: str, versions: Mapping[str, str]) -> TrialResult:
        (found,) = (one for seed in range(10) if (one := _trial(seed, versions["jax"])).id == trial_id)
        assert recorded(found.provenance, ("jax",)) == versions
        return found

    monkeypatch.setattr(Store, "made_with", made_with)
    return Store(Path("nowhere"))


def _environment(store: Store, version: str, outcome: str = "supported") -> Judged:
    """Return what came of an environment with a version of jax; the claim `plain` has no trials."""
    ids = tuple(_trial(seed, "1").id for seed in range(10))
    source = SourceTrials("hand_built", "parity", CONDITION.id, ids, {"jax": (version,)}, ())
    reports = [report("ours", outcome, sources=(source,)), report("plain", "not run", verdict=None)]
    return judged(f"jax {version}", reports, store)


@pytest.fixture
def found(store: Store) -> Across:
    """Four versions of jax, and one that cannot be installed."""
    fifth = Judged("jax 5", {}, {}, trouble="no such release")
    one, two, three, four = (
        _environment(store, version, outcome)
        for version, outcome in (("1", "supported"), ("2", "supported"), ("3", "refuted"), ("4", "supported"))
    )
    return across([one, two, fifth, three, four])


def test_each_cell_tells_verdict_drift_and_bits_against_the_first_environment(found: Across) -> None:
    told = {
        label.removeprefix("jax "): across_report.cell_lines(cell)
        for (claim, label), cell in found.cells.items()
        if claim == "ours"
    }
    assert told["1"] == ("✓ supported",)
    assert told["2"] == ("✓ supported", "same to the bit")
    assert told["3"] == ("✗ refuted, CHANGED", "A12 0.00, p 5e-05, DRIFT", "10 of 10 differ")
    assert told["4"] == ("✓ supported", "A12 0.50, p 1", "10 of 10 differ")
    assert across_report.cell_lines(found.cells["plain", "jax 3"]) == ("- not run", "–")
    assert found.changed == {"jax 3": ["ours"]}


def test_lines_say_why_one_has_no_verdicts_which_changed_and_what_drifted_how_far(found: Across) -> None:
    numbers = "is lower now: median 0.545 -> 0.295, A12 = 0.00, p = 5e-05 (Holm)"
    assert found.lines == [
        "jax 5: no verdicts: no such release",
        "jax 3: ours: supported -> refuted",
        f"jax 3: DRIFT in hand_built on parity: mean_success {numbers}",
        f"jax 3: DRIFT in hand_built on parity: last_fitness {numbers}",
        "jax 4: no drift shown; nearest: hand_built on parity: mean_success: median 0.545 -> 0.545, A12 = 0.50, p = 1 "
        "(Holm); found would have been with probability 0.95 a shift of all conditions by 2.1 SD in hand_built",
    ]


def test_a_cell_whose_trials_drifted_says_so_though_all_that_could_be_compared_have_the_same_bits(
    found: Across,
) -> None:
    cell = replace(found.cells["ours", "jax 3"], compared=1, changed=0)
    assert across_report.cell_lines(cell)[1:] == ("A12 0.00, p 5e-05, DRIFT", "0 of 1 differ")


def test_trials_that_are_the_same_records_are_not_compared(store: Store) -> None:
    again = replace(_environment(store, "1"), label="again")
    cell = across([_environment(store, "1"), again]).cells["ours", "again"]
    assert across_report.cell_lines(cell) == ("✓ supported", "the same trials")


def test_a_claim_that_only_one_environment_has_is_a_change(store: Store) -> None:
    """As where its cases are a list of the package."""
    one, two = _environment(store, "1"), _environment(store, "2")
    without = replace(two, reports={"plain": two.reports["plain"]}, trials={})
    gone, new = across([one, without]), across([without, replace(one, label="jax 1")])
    assert gone.changed == {"jax 2": ["ours"]}
    assert gone.lines[0] == "jax 2: ours: supported -> not run (there is no such claim in it)"
    assert across_report.headline(gone) == "jax 2 changes ours."
    assert [row["outcome"] for row in across_report.rows(gone) if row["claim"] == "ours"] == ["supported", "not run"]
    assert new.changed == {"jax 1": ["ours"]}
    assert across_report.cell_lines(new.cells["ours", "jax 1"]) == ("✓ supported, CHANGED", "–")


def test_trials_of_which_some_cannot_be_compared_are_not_the_same_to_the_bit(store: Store) -> None:
    first = _environment(store, "1")
    (trials,) = first.trials.values()
    first = replace(first, trials=dict.fromkeys(first.trials, trials[:4]))
    cell = across([first, _environment(store, "2")]).cells["ours", "jax 2"]
    assert across_report.cell_lines(cell) == ("✓ supported", "0 of 4 differ")


def test_trials_that_the_first_environment_lacks_are_not_called_the_same(store: Store) -> None:
    first = _environment(store, "1", "error")
    source = replace(first.reports["ours"].sources[0], trials=())
    first = judged("jax 1", [replace(first.reports["ours"], sources=(source,))], store)
    cell = across([first, _environment(store, "2")]).cells["ours", "jax 2"]
    assert across_report.cell_lines(cell) == ("✓ supported, CHANGED", "–")


def test_what_cannot_be_compared_is_told_apart_from_what_is_the_same(store: Store) -> None:
    """Trials of another machine or of none have bits, and too few of them drift, that nobody knows."""
    first, four = _environment(store, "1"), _environment(store, "4")
    ((name, trials),) = four.trials.items()
    elsewhere = tuple(replace(one, provenance={**one.provenance, "machine": "other"}) for one in trials)
    few, others = {name: elsewhere[:2]}, {name: (*trials[:8], *elsewhere[8:])}
    cells = [across([first, replace(four, trials=those)]).cells["ours", "jax 4"] for those in (few, others, {})]
    apart = [{str(trial.seed) for trial in trials[:2]}, {str(trial.seed) for trial in trials[8:]}, {""}]
    assert [{seed for _, seed in cell.without_bits} for cell in cells] == apart
    assert [bool(cell.untested) for cell in cells] == [True, False, True]
    for same in (_environment(store, "2"), replace(first, label="again")):
        cell = across([first, same]).cells["ours", same.label]
        assert (cell.without_bits, cell.untested) == (frozenset(), frozenset())


def test_what_did_not_change_is_said_as_far_as_it_was_compared(store: Store) -> None:
    one, two = (replace(_environment(store, version), label=version) for version in "12")
    only = [replace(each, reports={"ours": each.reports["ours"]}) for each in (one, two, replace(one, label="again"))]
    said = "the same verdict, no drift shown, 10 trials the same to the bit"
    assert _unchanged(only[0], only[1], list(KINDS)) == said
    said = "the same verdict, the same trials, since none depends on it"
    assert _unchanged(only[0], only[2], list(KINDS)) == said


def test_the_first_environment_is_the_first_that_has_verdicts(store: Store) -> None:
    broken = Judged("jax 0", {}, {}, trouble="no such release")
    found = across([broken, _environment(store, "3"), _environment(store, "1")])
    assert found.cells["ours", "jax 3"].was is None
    assert found.cells["ours", "jax 1"].drifted


@pytest.mark.parametrize("width", [40, 80, 200])
def test_the_table_shows_every_environment_at_any_width(found: Across, width: int) -> None:
    console = PlainSpokenConsole(width=width, record=True, file=io.StringIO())
    for part in across_report.terminal(found, width):
        console.print(part)
    text = console.export_text()
    assert all(f"jax {version}" in text for version in "12345")
    assert max(map(len, text.splitlines())) <= width
    assert text.count("same to the bit") == 1


def test_the_text_of_an_issue_begins_with_what_changed_and_ends_with_the_command(found: Across) -> None:
    text = across_report.markdown(found, "evoclaims across --package jax 1 2")
    assert text.startswith(
        "# jax 3 changes ours; jax 5 has no verdicts.\n\n| claim | jax 1 | jax 2 | jax 5 | jax 3 | jax 4 |\n"
    )
    assert "| ✗ refuted, CHANGED<br>A12 0.00, p 5e-05, DRIFT<br>10 of 10 differ |" in text
    assert text.endswith("```sh\nevoclaims across --package jax 1 2\n```\n")


def test_rows_for_programs_have_numbers_and_one_for_each_environment_without_verdicts(found: Across) -> None:
    rows = across_report.rows(found)
    (three,) = (row for row in rows if row["environment"] == "jax 3" and row["claim"] == "ours")
    assert (three["drift_median_ref"], three["drift_median_new"]) == pytest.approx((0.545, 0.295))
    assert (three["versions"], three["verdict_changed"], three["bits_changed"]) == ({"jax": ["3"]}, True, 10)
    assert rows[-1] == {"environment": "jax 5", "trouble": "no such release"}
    assert len(rows) == 4 * 2 + 1


def test_trials_out_of_time_are_no_drift_and_no_change_of_bits() -> None:
    """A slow release has the same results, as far as anybody knows."""
    before = tuple(_trial(seed, "1") for seed in range(10))
    now = tuple(
        replace(_trial(seed, "2"), status="timeout", digest="9" * 64, metrics={}) if seed > 3 else _trial(seed, "2")
        for seed in range(10)
    )
    one = Succession("ours", {"jax": "1"}, {"jax": "2"}, before, now, again=10)
    found = upgrade([one])
    assert ([new.seed for _, new in one.pairs], one.changed) == ([0, 1, 2, 3], 0)
    assert not any(row.drifted for row in found.drift.rows)
    late = replace(one, now=now[4:])
    assert "(another machine or device, or out of time)" in " ".join(upgrade([late]).lines)
