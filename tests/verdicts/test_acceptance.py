"""Accepting: what differs is written down with what made it, and nothing that says nothing replaces a verdict."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from hand_made_verdicts import report, verdict

from evoclaims.judging.verdict import Outcome
from evoclaims.paper.archive import Archive
from evoclaims.paper.reproduction import Reproduction
from evoclaims.trials.store import Store
from evoclaims.verdicts.acceptance import accept, entry_of
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.history import History
from evoclaims.verdicts.source_trials import SourceTrials

Report = Callable[..., ClaimReport]
KEY = ("smoke", "G1")


def _provenance(jax: str = "0.10.2", kind: str = "cpu", sha: str = "a" * 40, **more: Any) -> dict[str, Any]:
    return {
        "versions": {"jax": jax, "qdax": None},
        "device": {"kind": kind, "platform": "cpu" if kind == "cpu" else "gpu"},
        "git": {"sha": sha, "dirty": False},
        "cuda": {"nvidia-cublas": "13.0"},
        **more,
    }


@pytest.fixture
def judged(store: Store, made: Any, reproduction: Reproduction) -> Report:
    """A function that stores trials with the given provenances and returns a report about them."""
    condition = reproduction.tier("smoke").condition("better", "small")

    def make(*provenances: dict[str, Any], **fields: Any) -> ClaimReport:
        trials = []
        for provenance in provenances:
            seed = len(store.ids())
            store.put(made(condition, seed, 1.0, **provenance), {})
            trials.append(made(condition, seed, 1.0).id)
        sources = (SourceTrials("better", "small", condition.id, tuple(trials), {}, ()),)
        basis = report("G1", reason="so", verdict=verdict(n=len(trials), p=0.03), sources=sources)
        return replace(basis, **fields)

    return make


def _accept(store: Store, history: History, *reports: ClaimReport) -> tuple[History, tuple[str, ...], tuple[str, ...]]:
    made = accept(history, reports, Archive(store), "2025-11-02")
    return made.history, made.accepted, made.left


def test_an_entry_says_what_was_judged_and_what_made_its_trials(store: Store, judged: Report) -> None:
    entry = entry_of(judged(_provenance(), _provenance()), Archive(store), "2025-11-02")
    assert (entry.outcome, entry.reason, entry.n, entry.p) == (Outcome.SUPPORTED, "so", 2, 0.03)
    assert (entry.fingerprint, entry.accepted) == ("f" * 64, "2025-11-02")
    assert (entry.versions, entry.device, entry.revision) == ({"jax": "0.10.2"}, "cpu", "a" * 40)


def test_trials_of_several_devices_and_versions_are_said_with_all_of_them(store: Store, judged: Report) -> None:
    other = _provenance("0.11.2", "NVIDIA H200", "b" * 40, git={"sha": "b" * 40, "dirty": True})
    entry = entry_of(judged(other, _provenance()), Archive(store), "2025-11-02")
    assert entry.versions == {"jax": "0.10.2, 0.11.2", "nvidia-cublas": "13.0"}
    assert (entry.device, entry.revision) == ("NVIDIA H200, cpu", f"{'a' * 40}, {'b' * 40}-dirty")


def test_records_that_do_not_say_where_they_come_from_leave_empty_places(store: Store, judged: Report) -> None:
    entry = entry_of(judged({}, {"device": None, "git": None, "versions": None}), Archive(store), "2025-11-02")
    assert (entry.versions, entry.device, entry.revision) == ({}, "", "")


def test_the_hash_of_the_trials_follows_from_their_digests(store: Store, judged: Report, made: Any) -> None:
    one, other = judged(_provenance()), judged(_provenance())
    hashes = {entry_of(report, Archive(store), "2025-11-02").trials for report in (one, other, one)}
    assert len(hashes) == 2


@pytest.mark.parametrize(
    ("provenance", "fields", "said"),
    [
        ({}, {"outcome": Outcome.REFUTED}, "supported -> refuted"),
        ({"jax": "0.11.2"}, {}, "still supported (by jax 0.10.2 -> 0.11.2)"),
        (
            {"jax": "0.11.2", "kind": "TPU"},
            {"outcome": Outcome.INCONCLUSIVE},
            "supported -> inconclusive (by jax 0.10.2 -> 0.11.2, nvidia-cublas none -> 13.0, device cpu -> TPU)",
        ),
        ({}, {"reason": "p = 0.03"}, "still supported, by other trials"),
        (
            {},
            {"verdict": verdict(fingerprint="e" * 64)},
            "supported; a new history begins, since what is judged has changed (it was supported)",
        ),
    ],
)
def test_what_differs_is_a_new_entry_and_is_said(
    store: Store, judged: Report, provenance: dict[str, str], fields: dict[str, Any], said: str
) -> None:
    before, _, _ = _accept(store, {}, judged(_provenance()))
    history, accepted, left = _accept(store, before, judged(_provenance(**provenance), **fields))
    assert (accepted, left) == ((f"G1 (smoke): {said}",), ())
    assert history[KEY][:1] == before[KEY]
    assert len(history[KEY]) == 2


def test_an_entry_that_the_same_trials_no_longer_give_is_replaced(store: Store, judged: Report) -> None:
    """Of a file that was edited, or a judge that computes something else now."""
    one = judged(_provenance())
    before, _, _ = _accept(store, {}, one)
    for p, n in ((0.9, 1), (0.03, 3)):
        edited = {KEY: (replace(before[KEY][0], p=p, n=n),)}
        history, accepted, _ = _accept(store, edited, one)
        said = f"G1 (smoke): still supported, from the same trials with another p or n ({p} of {n} before)"
        assert (accepted, history[KEY][-1]) == ((said,), before[KEY][0])
    rounded = {KEY: (replace(before[KEY][0], p=0.03 * (1 + 1e-9)),)}
    assert _accept(store, rounded, one)[1] == ()


def test_new_trials_of_another_revision_alone_are_no_new_entry(store: Store, judged: Report) -> None:
    before, _, _ = _accept(store, {}, judged(_provenance()))
    assert _accept(store, before, judged(_provenance(sha="c" * 40)))[:2] == (before, ())


def test_a_claim_that_has_lost_its_test_at_a_tier_loses_the_verdicts_it_had_there(store: Store, judged: Report) -> None:
    before, _, _ = _accept(store, {}, judged(_provenance()))
    before = {**before, ("full", "G1"): before[KEY]}
    untested = judged(outcome=Outcome.NOT_RUN, reason="it has no smoke test: because", has_test=False)
    made = accept(before, [untested], Archive(store), "2025-11-02")
    assert made.retired == ("G1 (smoke), which was supported: it has no smoke test: because",)
    assert made.history == {("full", "G1"): before[KEY]}
    assert (made.accepted, made.left) == ((), ())
    assert accept(made.history, [untested], Archive(store), "2025-11-02").retired == ()


@pytest.mark.parametrize("outcome", ["not run", "error"])
def test_what_says_nothing_of_a_claim_is_never_accepted(store: Store, judged: Report, outcome: str) -> None:
    silent = judged(outcome=Outcome(outcome), reason="10 trials\x1b are missing")
    assert _accept(store, {}, silent)[:2] == ({}, ())
    before, _, _ = _accept(store, {}, judged(_provenance()))
    history, accepted, left = _accept(store, before, silent)
    assert (history, accepted) == (before, ())
    assert left == (
        f"G1 (smoke) is {outcome} now (10 trials\\x1b are missing): it stays supported, accepted on 2025-11-02",
    )
