"""A drift is repeated with fresh seeds where that can tell it from chance, and stands everywhere else."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import pytest
from made_trials import trial_of

from evoclaims.claims import earlier_trials
from evoclaims.claims.claim import Claim, ClaimTest
from evoclaims.claims.fetching import NotStoredError, RunMissing, StoredOnly
from evoclaims.claims.session import Session
from evoclaims.judging.drift_report import DriftReport, DriftRow
from evoclaims.paper import pilots, references
from evoclaims.paper.archive import Archive
from evoclaims.paper.reproduction import Reproduction
from evoclaims.trials.progress import ignore
from evoclaims.trials.result import Status, TrialResult
from evoclaims.trials.spec import Condition
from evoclaims.trials.store import Store

HERE: dict[str, Any] = {
    "device": {"platform": "cpu", "kind": "cpu", "count": 1},
    "machine": "an abacus",
    "versions": {"jax": "1.0"},
    "git": {"sha": "a" * 40, "dirty": False},
}
ELSEWHERE = {"machine": "a slide rule"}
LAST_PILOT = 47
FRESH = "18 trials of each condition of better (smoke), with fresh seeds"


@pytest.fixture
def session(reproduction: Reproduction, store: Store, served: Any) -> Session:
    """A session of a tier that repeats drift, with ten reference trials and a pilot of "better on small"."""
    tiers = {**reproduction.tiers, "smoke": replace(reproduction.tiers["smoke"], repeat_drift=True)}
    return Session(replace(reproduction, tiers=tiers), store, served(lambda condition, seed: 0.5))


def _made(condition: Condition, seed: int, value: float, status: Status = "done", **ours: Any) -> TrialResult:
    return trial_of(condition, seed, value, status, provenance={**HERE, **ours})


Repeat = Callable[..., tuple[DriftReport, list[int], list[str]]]


@pytest.fixture
def repeat(session: Session, says: Claim) -> Repeat:
    """A function that lets "better on small" drift and repeats this; returns what was found, run and said."""

    def run(
        fresh: Callable[[int], float],
        now: Session = session,
        trials: Mapping[str, Any] | None = None,
        reference: Mapping[str, Any] = ELSEWHERE,
        **ours: Any,
    ) -> tuple[DriftReport, list[int], list[str]]:
        better = session.group("better", "small", "smoke")
        condition, asked, said = better.condition, list[int](), list[str]()
        path = references.path_of(session.reproduction.references, "smoke", "better", "small")
        references.write(path, [_made(condition, seed, seed / 100, **reference) for seed in range(10)])
        claim = better.solves_every_level.in_most_trials()
        place = pilots.path_of(session.reproduction.folder, "smoke", "better", "small", second=False)
        pilot = [_made(condition, seed, seed % 10 / 100) for seed in range(20, LAST_PILOT + 1)]
        pilots.write(place, pilot, claim.readings())
        for seed in range(6):
            session.store.put(_made(condition, seed, 0.5 + seed / 100, **(trials or {})), {})

        def fetch(condition: Condition, seeds: Sequence[int]) -> Sequence[TrialResult]:
            if max(seeds) < 6:
                return [_made(condition, seed, 0.5 + seed / 100, **(trials or {})) for seed in seeds]
            asked.extend(seeds)
            return [_made(condition, seed, fresh(seed), **ours) for seed in seeds]

        reports = [replace(session, fetch=fetch).settle(ClaimTest(says, "smoke", ""), claim)]
        mine = now if now.fetch is not session.fetch else replace(now, fetch=fetch)
        found, _ = earlier_trials.drift(mine, reports)
        assert found.drifted
        return earlier_trials.repeated(mine, reports, found, said.append), asked, said

    return run


def _as_before(seed: int) -> float:
    return seed % 10 / 100


def _moved(seed: int) -> float:
    return 0.5 + seed % 10 / 100


def test_what_fresh_trials_do_not_show_fails_no_run(repeat: Repeat) -> None:
    found, asked, said = repeat(_as_before)
    assert not found.drifted
    assert {row.status for row in found.rows} == {"not repeated"}
    assert asked == [*range(LAST_PILOT + 1, LAST_PILOT + 19)]  # three times six, with seeds that no trial has
    assert said == ["better (smoke) has drifted; 3 times as many trials, with fresh seeds, tell this from chance"]
    assert any(line.startswith("not repeated: better on small (smoke): mean_success: median ") for line in found.lines)
    (sentence,) = found.repetitions
    assert sentence.startswith(
        "  18 trials of each condition of better (smoke), with fresh seeds: no drift shown; nearest: better on "
    )
    assert "found would have been with probability 0.95 a shift" in sentence
    assert not found.unchecked
    assert found.nearest is None


def test_no_other_measure_of_a_method_whose_drift_was_not_repeated_is_called_the_nearest() -> None:
    """All its measures have the p of its joint test, by which it has drifted."""
    shown = DriftRow("a on t (smoke)", "reward", 6, 10, "drift", 0.001, 0.002, a12=1.0, median_new=2.0, median_ref=1.0)
    report = DriftReport((shown, replace(shown, metric="steps", status="no drift", p=0.5)), 0.01)
    again = DriftReport((replace(shown, n_new=18, status="no drift", p=0.5, p_holm=0.5),), 0.05)
    found = report.repeated_by(again, "a (smoke)", {shown.label})
    assert [row.status for row in found.rows] == ["not repeated", "no drift"]
    assert found.nearest is None
    other = replace(shown, label="b on t (smoke)", status="no drift", p=0.3, p_holm=0.6)
    assert replace(found, rows=(*found.rows, other)).nearest == other


def test_what_fresh_trials_show_too_stands(repeat: Repeat) -> None:
    found, _, _ = repeat(_moved)
    assert found.drifted
    assert {row.status for row in found.rows} == {"drift"}
    (sentence,) = found.repetitions
    assert sentence.startswith(
        "  it stands: 18 trials of each condition of better (smoke), with fresh seeds: DRIFT in better on small"
    )


@pytest.mark.parametrize(
    "elsewhere",
    [
        {"machine": "another abacus"},
        {"versions": {"jax": "2.0"}},
        {"git": {"sha": "b" * 40, "dirty": False}},
        {"code_hashes": {"Method": "edited"}},
    ],
)
def test_trials_made_elsewhere_or_by_other_code_are_no_repetition(repeat: Repeat, elsewhere: dict[str, Any]) -> None:
    found, _, _ = repeat(_as_before, **elsewhere)
    assert found.drifted
    (sentence,) = found.repetitions
    assert sentence.startswith(
        "  it stands: there are no trials of better (smoke) with fresh seeds: those of better on"
    )
    assert sentence.endswith("were made on another machine, with other versions, or by other code")


def test_fresh_trials_that_cannot_be_compared_are_no_repetition(repeat: Repeat) -> None:
    found, _, _ = repeat(_as_before, status="crashed")
    assert found.drifted
    assert "not checked: better on small (smoke): trials crashed: seeds 48, 49" in found.repetitions[0]


def test_other_bits_than_on_the_same_machine_before_are_no_chance(repeat: Repeat) -> None:
    found, asked, said = repeat(_as_before, reference={})
    assert (found.drifted, asked, said) == (True, [], [])
    assert found.repetitions[0].endswith(
        "those of better on small (smoke) have other bits than reference trials of the same seeds, machine and "
        "versions, and that is no chance"
    )


def test_trials_of_a_gpu_are_not_repeated_on_a_processor(repeat: Repeat) -> None:
    found, asked, said = repeat(_as_before, trials={"device": {"platform": "gpu", "kind": "H", "count": 1}})
    assert (found.drifted, asked, said) == (True, [], [])
    assert "they run on CPUs, and those of better on small (smoke) did not" in found.repetitions[0]


def test_code_that_was_not_committed_may_have_been_edited_since(repeat: Repeat, session: Session) -> None:
    dirty = {"git": {"sha": "a" * 40, "dirty": True}}
    condition = session.group("better", "small", "smoke").condition
    for seed in range(LAST_PILOT + 1, LAST_PILOT + 19):
        session.store.put(_made(condition, seed, _as_before(seed), **dirty), {})
    for now in (session, replace(session, fetch=StoredOnly(Archive(session.store)))):
        found, asked, said = repeat(_as_before, now, trials=dirty, **dirty)
        assert (found.drifted, asked, said) == (True, [], [])
        assert found.repetitions[0].endswith("were made by code that was not committed, and may differ now")


def test_none_run_under_a_time_limit_or_where_trials_are_only_read(repeat: Repeat, session: Session) -> None:
    limited = replace(session, fetch=RunMissing(session.store, "cpu", ignore, time_limit=60.0))
    read = replace(session, fetch=StoredOnly(Archive(session.store)))
    for now, why in (
        (limited, "they run on CPUs, and not under a time limit below an hour"),
        (read, "18 of 18 trials are missing"),
    ):
        found, _, said = repeat(_as_before, now)
        assert (found.drifted, said) == (True, [])
        assert found.repetitions == (f"  it stands: there are no trials of better (smoke) with fresh seeds: {why}",)


def test_fresh_trials_that_are_stored_are_read_again(repeat: Repeat, session: Session) -> None:
    condition = session.group("better", "small", "smoke").condition
    for seed in range(LAST_PILOT + 1, LAST_PILOT + 19):
        session.store.put(_made(condition, seed, _as_before(seed)), {})
    found, _, _ = repeat(_moved, replace(session, fetch=StoredOnly(Archive(session.store))))
    assert not found.drifted


def test_other_tiers_repeat_nothing(repeat: Repeat, session: Session) -> None:
    tiers = {name: replace(tier, repeat_drift=False) for name, tier in session.reproduction.tiers.items()}
    found, asked, said = repeat(_as_before, replace(session, reproduction=replace(session.reproduction, tiers=tiers)))
    assert (found.drifted, found.repetitions, asked, said) == (True, (), [], [])


def test_a_store_that_cannot_be_written_lets_the_drift_stand(repeat: Repeat, session: Session) -> None:
    def refuse(condition: Condition, seeds: Sequence[int]) -> Sequence[TrialResult]:
        raise NotStoredError("the disk is full", condition.id)

    found, _, _ = repeat(_as_before, replace(session, fetch=refuse))
    assert found.drifted
    assert found.repetitions[0].endswith("with fresh seeds: the disk is full")


def test_what_a_method_raises_is_a_sentence_and_no_traceback(repeat: Repeat, session: Session) -> None:
    def fail(condition: Condition, seeds: Sequence[int]) -> Sequence[TrialResult]:
        raise RuntimeError("out of order")

    found, _, _ = repeat(_as_before, replace(session, fetch=fail))
    assert found.drifted
    assert "with fresh seeds: RuntimeError: out of order (" in found.repetitions[0]
