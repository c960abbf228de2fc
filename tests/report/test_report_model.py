"""What a report says of claims and trials, and of everything that may be wrong with them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from laboratory import CONDITIONS, HERE, Laboratory, better_solves, better_wins, record
from unpacked import whole

from evoclaims.judging.verdict import Outcome
from evoclaims.paper.archive import Archive
from evoclaims.report.formatting import Anchors
from evoclaims.verdicts.history import AcceptedVerdict


def test_a_section_holds_what_was_claimed_judged_and_looked_at(filled: Laboratory) -> None:
    report = filled.judge(better_wins, case="small")
    page = filled.page(report)
    section = page.sections[0]
    assert section.report == report
    assert (section.anchor, section.places, section.methods) == ("T1-small-full", ("§1.2",), ("better", "worse"))
    (part,) = section.parts
    labels = [f"{method} on small: mean success over levels" for method in ("better", "worse")]
    assert [strip.label for strip in part.strips] == labels
    assert [(dot.seed, dot.value) for dot in part.strips[0].dots] == list(enumerate([1.0, 0.9, 0.9, 0.8, 0.8, 0.7]))
    assert section.devices == "12 × cpu"
    assert section.warnings == ()
    conditions = [page.conditions[key] for key in section.conditions]
    assert [one.label for one in conditions] == ["better on small", "worse on small"]
    assert ("task bits", "3") in conditions[0].settings
    assert [panel.name for panel in conditions[0].curves] == ["success"]
    assert conditions[0].says == "6 trials. Level is 0 throughout training."


def test_every_trial_is_read_once_for_all_claims(filled: Laboratory, monkeypatch: pytest.MonkeyPatch) -> None:
    reports = [filled.judge(better_wins, id=name) for name in ("T1", "T2", "T3")]
    asked: list[str] = []
    get = Archive.get
    monkeypatch.setattr(Archive, "get", lambda self, trial, versions: asked.append(trial) or get(self, trial, versions))
    page = filled.page(*reports)
    assert len(asked) == len(set(asked)) == 12
    assert len(page.conditions) == 2


def test_claims_stand_in_the_order_of_the_paper(filled: Laboratory) -> None:
    reports = [
        filled.judge(better_wins, id=name, where=where)
        for name, where in (("C1", "control"), ("G10", "§5.2"), ("G2", "§5.2"), ("A1", "§5.10"), ("Z1", "§4"))
    ]
    page = filled.page(*reports)
    assert [section.report.name for section in page.sections] == ["Z1", "G2", "G10", "A1", "C1"]


def test_a_smaller_tier_shows_the_papers_own_sentence_too(filled: Laboratory) -> None:
    report = filled.judge(better_wins, tier="smoke")
    section = filled.section(report, sentences={"T1": "Better is better"})
    assert (section.paper, section.report.statement) == ("Better is better", "In small")
    full = filled.section(filled.judge(better_wins), sentences={"T1": "Better is better"})
    assert (full.paper, full.report.statement) == ("", "Better is better")


def test_diverged_trials_stand_apart_and_are_said(lab: Laboratory) -> None:
    lab.put("better", [1.0] * 6)
    lab.put("worse", [0.1] * 4)
    for seed in (4, 5):
        lab.store.put(record(CONDITIONS["worse", "small"], seed, 0.3, status="diverged"), {})
    section = lab.section(lab.judge(better_wins))
    better, worse = section.parts[0].strips
    assert better.apart == ()
    assert (worse.apart, len(worse.dots), worse.n) == (((4, "diverged"), (5, "diverged")), 4, 6)
    assert section.warnings == ("2 of 12 trials diverged and count as the worst result (seeds 4, 5).",)


@pytest.mark.parametrize(
    ("status", "said"),
    [
        ("crashed", "1 of 12 trials crashed, so that the claim is an error (seeds 5)."),
        ("timeout", "1 of 12 trials ran out of time, with results that are unknown and decide nothing (seeds 5)."),
    ],
)
def test_what_is_said_of_a_trial_without_a_result_is_true_of_it(lab: Laboratory, status: str, said: str) -> None:
    lab.put("better", [1.0] * 6)
    lab.put("worse", [0.1] * 5)
    lab.store.put(record(CONDITIONS["worse", "small"], 5, 0.3, status=status), {})
    assert lab.section(lab.judge(better_wins)).warnings == (said,)


def test_a_nan_is_an_error_that_shows_which_trial_holds_it(lab: Laboratory) -> None:
    lab.put("better", [1.0, 1.0, float("nan"), 1.0, 1.0, 1.0])
    lab.put("worse", [0.1] * 6)
    page = lab.page(lab.judge(better_wins))
    section = page.sections[0]
    assert section.report.outcome is Outcome.ERROR
    assert "NaN in the finished trial of seed 2" in section.report.reason
    assert section.parts[0].strips[0].apart == ((2, "NaN"),)
    assert "The mean success of finished trials is NaN (seeds 2)." in section.warnings
    assert page.notices == (f"1 claim ended in error. {section.report.reason}",)


def test_trials_from_mixed_devices_and_changed_code_are_said(lab: Laboratory) -> None:
    lab.put("better", [1.0] * 6)
    other = {**HERE, "device": {"platform": "gpu", "kind": "NVIDIA H200"}, "git": {"sha": "b" * 40, "dirty": True}}
    lab.put("worse", [0.0] * 5, provenance=other)
    lab.store.put(record(CONDITIONS["worse", "small"], 5, 0.0, provenance={}), {})
    section = lab.section(lab.judge(better_wins))
    assert section.warnings == (
        "Trials from mixed devices: 6 × cpu, 5 × NVIDIA H200 (gpu), 1 × unknown device.",
        "5 trials of 12 ran code with uncommitted changes.",
        "1 trial of 12 ran code of unknown revision.",
    )
    assert [(count, origin.code) for origin, count in section.made.most_common()] == [
        (6, "aaaaaaaaa, clean"),
        (5, "bbbbbbbbb, with uncommitted changes"),
        (1, "unknown revision"),
    ]


def test_a_method_edited_after_its_trials_is_said(filled: Laboratory) -> None:
    report = filled.judge(better_wins)
    one, *others = report.sources
    edited = replace(report, sources=(replace(one, edited=("my_paper.Own",)), *others))
    assert filled.section(report).warnings == ()
    assert filled.section(edited).warnings == (
        "The code of my_paper.Own was edited or renamed after trials had run, and they still count: if it computes "
        "something else now, raise its `revision`, and they run again.",
    )


def test_a_claim_without_trials_says_why(lab: Laboratory) -> None:
    lab.put("better", [1.0] * 2)
    page = lab.page(lab.judge(better_solves))
    section = page.sections[0]
    assert section.report.outcome is Outcome.NOT_RUN
    assert section.report.reason == "better on small: 4 of 6 trials are missing"
    assert (section.parts, section.conditions, section.made.total()) == ((), (), 0)
    assert page.notices[0].startswith("No claim has been judged: neither the store nor the committed reference trials")


def test_a_record_that_breaks_after_judging_is_said_and_left_out(filled: Laboratory) -> None:
    report = filled.judge(better_wins)
    next(filled.store.record_paths()).write_text("{")
    page = filled.page(report)
    assert "it is not one whole JSON text" in page.notices[0]
    assert page.sections[0].made.total() == 11


def test_the_history_says_when_rules_changed_and_what_differs_now(filled: Laboratory) -> None:
    report = filled.judge(better_wins)
    now = report.fingerprint

    def entry(outcome: Outcome, fingerprint: str, date: str) -> AcceptedVerdict:
        return AcceptedVerdict(
            outcome, "why", 6, 0.5, fingerprint, date, {"jax": "0.10.2"}, "cpu", "a" * 40 + "-dirty", ""
        )

    old, same = entry(Outcome.SUPPORTED, "f" * 64, "2026-01-01"), entry(Outcome.REFUTED, now, "2026-02-02")

    def shown(*entries: AcceptedVerdict) -> Any:
        return filled.section(report, history={("full", "T1"): entries})

    section = shown(old, same)
    assert section.history == ((old,), (same,))
    page = filled.page(report, history={("full", "T1"): (old, same)})
    shown_page = whole(page)
    assert shown_page.count('<tr class="era"><td>2026-02-02</td>') == shown_page.count('class="era"') == 1
    assert '<td title="jax 0.10.2">cpu, revision aaaaaaaaa-dirty</td>' in shown_page
    assert section.change == "Accepted on 2026-02-02 as refuted; now supported."
    assert shown(old).change == "What was fixed beforehand has changed since 2026-01-01: a new history begins."
    assert shown(replace(same, outcome=Outcome.SUPPORTED)).change == ""
    assert shown().history == ()


@given(st.lists(st.tuples(st.text(), st.text(), st.sampled_from(["full", "smoke"])), max_size=20))
def test_anchors_are_safe_in_an_address_and_never_given_twice(names: list[tuple[str, str, str]]) -> None:
    anchors = Anchors()
    given_ = [anchors.new(*name) for name in names]
    assert len(set(given_)) == len(names)
    assert all(anchor.isascii() and not set(anchor) & set(" #?%&<>\"'/") and anchor for anchor in given_)
