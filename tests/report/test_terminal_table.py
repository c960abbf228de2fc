"""Tables of verdicts: complete, in order, and showing what a sentence says as it stands."""

from __future__ import annotations

import io
import re
import sys
from dataclasses import replace

import pytest
from hand_made_verdicts import evidence, report, verdict
from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cell_len

from evoclaims.judging.drift_report import DriftReport, DriftRow
from evoclaims.judging.verdict import Outcome
from evoclaims.report.console import PlainSpokenConsole, plain_table
from evoclaims.report.terminal_table import drift_lines, explanations, verdict_table


def test_a_row_shows_claim_sentence_verdict_n_effect_p_and_evidence() -> None:
    parts = (evidence(0.5), evidence(0.9375))
    judged = report(case="n_parity", evidence="a/verdicts/smoke/G1.json", verdict=verdict(evidence=parts, deciding=1))
    table = verdict_table([judged], 160, False)
    _, row, *_, caption = table.splitlines()
    cells = re.split(r" {2,}", row.strip())
    assert cells == [
        "G1[n_parity]",
        "All levels are solved (§5.1)",
        "✓ supported",
        "10",
        "0.94",
        "0.028 (0.028)",
        "G1.json",
    ]
    assert caption == "evidence: a/verdicts/smoke/<claim>.json"


def test_a_refuted_claim_shows_the_p_against_it_and_the_effect_of_the_part_that_decided() -> None:
    parts = (evidence(0.5), evidence(0.0625), evidence(None))
    refuted = report(outcome="refuted", verdict=verdict("refuted", evidence=parts, deciding=1))
    _, row = verdict_table([refuted], 160, False).splitlines()
    assert re.split(r" {2,}", row.strip())[2:] == ["✗ refuted", "10", "0.06", "against 0.0043 (0.0042)"]
    without = replace(refuted, verdict=verdict("refuted", evidence=parts, deciding=2))
    assert re.split(r" {2,}", verdict_table([without], 160, False).splitlines()[1].strip())[4] == "–"
    unmeasured = verdict_table([report(outcome="error", verdict=None)], 160, False).splitlines()[1]
    assert re.split(r" {2,}", unmeasured.strip())[2:] == ["E error", "–", "–", "–"]


def test_rows_come_in_the_order_in_which_people_count() -> None:
    names = ["G10", "C1", "G9", "G1"]
    table = verdict_table([report(name) for name in names], 120, False)
    assert [line.split()[0] for line in table.splitlines()[1:]] == ["C1", "G1", "G9", "G10"]


HOSTILE = ["[red]x[/red]", "[/]", "[bold", "[link=a]b[/link]", ":boom: :x:", "a\\", "100 % [50]", "\\[red]", "[[x]]"]


@pytest.mark.parametrize("text", HOSTILE)
def test_markup_in_a_sentence_is_shown_as_it_stands(text: str) -> None:
    hostile = report(outcome="refuted", statement=text, reason=text, because=text, expected="supported")
    assert f"{text} (§5.1)" in verdict_table([hostile], 160, False)
    assert f"G1: {text} [no longer supported, which was accepted: {text}]" in explanations([hostile], 160, False)


@pytest.mark.parametrize("text", ["\x1b[2J\x1b]0;title\x07", "a\rb", "\x9b31m", "\u202egnp", "a\x00b\x08"])
def test_a_sentence_cannot_steer_the_terminal(text: str) -> None:
    hostile = report("G1", "refuted", case=text, statement=text, reason=text, evidence=f"{text}/x")
    for shown in (verdict_table([hostile], 200, False), explanations([hostile], 200, False)):
        assert [c for c in shown if not c.isprintable() and c != "\n"] == []


@given(st.text(max_size=30))
def test_any_text_can_be_shown(text: str) -> None:
    fields = dict.fromkeys(("case", "statement", "where", "reason", "because"), text)
    odd = report("G1", "refuted", expected="error", **fields)
    for colour in (False, True):
        verdict_table([odd], 100, colour)
        explanations([odd], 100, colour)


def test_colour_is_used_only_where_it_is_wanted() -> None:
    refuted = report(outcome="refuted", expected="refuted")
    assert "\x1b[31m" in verdict_table([refuted], 120, True)
    plain = verdict_table([refuted], 120, False)
    assert "\x1b" not in plain
    assert "✗ refuted*" in plain


def test_only_what_is_not_plainly_supported_is_explained() -> None:
    plain = report()
    assert explanations([plain], 100, False) == ""
    assert explanations([replace(plain, expected=Outcome.SUPPORTED)], 100, False) == ""
    assert explanations([report("G2", "inconclusive")], 100, False) == "? G2: for a reason"
    accepted = report("G3", "refuted", expected="refuted", because="known")
    assert explanations([accepted], 100, False) == "✗ G3: for a reason [accepted: known]"
    surprising = replace(plain, expected=Outcome.REFUTED, because="known")
    assert explanations([surprising], 100, False) == (
        "✓ G1: for a reason [no longer refuted, which was accepted: known]"
    )
    not_run = replace(surprising, outcome=Outcome.NOT_RUN)  # which says nothing against what was accepted
    assert explanations([not_run], 100, False) == "- G1: for a reason"


def test_the_comparison_with_the_references_says_what_drifted_and_what_it_did_not_see() -> None:
    rows = (
        DriftRow("a on b", "steps", 10, 10, "drift", 0.0001, 0.0004, a12=0.125, median_new=30.0, median_ref=40.5),
        DriftRow("a on b", "success", 10, 10, "no drift", 0.5, 1.0),
        DriftRow("c on d", "success", 3, 0, "no reference", detail="0 reference trials, 10 needed"),
    )
    changed = ["a on b", "c on d", "a on b"]
    lines = drift_lines(DriftReport(rows, 0.01), changed, compared=4).splitlines()
    assert lines == [
        "reference trials: 2 comparisons, 1 drifted (by method, permutation tests, Holm, α = 0.01)",
        "DRIFT in a on b: steps is lower now: median 40.5 -> 30, A12 = 0.12, p = 0.0004 (Holm)",
        "not checked: c on d: 0 reference trials, 10 needed",
        "to the bit: 4 trials compared with the same machine and versions, 3 changed: a on b (2), c on d (1)",
    ]


@pytest.mark.parametrize(
    ("flags", "because"),
    [
        (None, "since none has a reference of the same machine and versions"),
        (
            "--xla_level=0",
            "since XLA_FLAGS here change bits (--xla_level=0), and none has a reference of the same flags, machine and "
            "versions",
        ),
    ],
)
def test_where_nothing_could_be_compared_to_the_bit_the_reason_is_said(
    monkeypatch: pytest.MonkeyPatch, flags: str | None, because: str
) -> None:
    monkeypatch.setattr("evoclaims.report.terminal_table.changing_flags", lambda: flags)
    last = drift_lines(DriftReport((), 0.01), changed=[], compared=0).splitlines()[-1]
    assert last == f"to the bit: no trial could be compared, {because}"


def test_without_drift_the_nearest_comparison_and_what_was_detectable_are_shown() -> None:
    near = DriftRow("a on b", "steps", 10, 60, "no drift", 0.02, 0.2, a12=0.7, median_new=3.0, median_ref=2.0)
    report = DriftReport((near,), 0.01, detectable={"b": 1.84, "a": 0.8, "c": 0.81})
    assert drift_lines(report, [], compared=3).splitlines()[1] == (
        "no drift shown; nearest: a on b: steps: median 2 -> 3, A12 = 0.70, p = 0.2 (Holm); found would "
        "have been with probability 0.95 a shift of all conditions by 0.8 SD in a, c, 1.8 SD in b"
    )


LONG = "NEAT climbs every level of every task that was ever posed, 和 never falls back"


@pytest.mark.parametrize("width", [20, 60, 80, 120])
def test_a_claim_is_one_line_at_any_width_and_its_id_is_whole(width: int) -> None:
    cases = ["", "cma_es-hyperneat-simple_alu", "in_a_case_of_so_many_parameters_that_no_terminal_is_wide_enough" * 2]
    reports = [report("G1", case=case, statement=LONG, evidence="a/verdicts/G1.json") for case in cases]
    heading, *rows, caption = verdict_table(reports, width, False).splitlines()
    assert caption.startswith("evidence: ")
    assert [row.split()[0] for row in rows] == [one.name for one in reports]
    assert all("✓ supported" in row for row in rows)
    if width >= 80:
        assert [cell_len(row) <= width for row in (heading, *rows)] == [True, True, True, False]
        assert all("NEAT climbs" in row and "…" in row for row in rows)


def test_columns_make_room_for_the_sentence_the_least_important_first() -> None:
    reports = [report(case="cma_es-hyperneat-simple_alu", statement=LONG, evidence="G1.json")]
    headings = {width: verdict_table(reports, width, False).splitlines()[0].split() for width in (60, 75, 80, 95, 120)}
    assert {width: " ".join(words[5:]) for width, words in headings.items()} == {
        60: "",
        75: "n A12",
        80: "n A12 p",
        95: "n A12 p (attainable)",
        120: "n A12 p (attainable) evidence",
    }


def test_trials_without_a_result_or_over_budget_are_told_of_whatever_the_verdict() -> None:
    for field in ("overspent", "copies"):
        shown = replace(report(), verdict=verdict(Outcome.SUPPORTED, **{field: "3 of 10 trials of a"}))
        assert explanations([shown], 200, colour=False).startswith("✓ ")
    over = replace(report(), verdict=verdict(Outcome.SUPPORTED, overspent="3 of 10 trials of a spent up to 9 of 5"))
    assert "[over budget: 3 of 10 trials of a spent up to 9 of 5]" in explanations([over], 200, colour=False)
    for outcome in ("supported", "refuted"):
        broken = verdict(outcome, without_result="2 of 10 trials of a ran out of time (seeds 0, 3)")
        told = explanations([report(outcome=outcome, verdict=broken)], 160, False)
        assert told.endswith("G1: for a reason [worst rank: 2 of 10 trials of a ran out of time (seeds 0, 3)]")


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "koi8-r", None])
@pytest.mark.parametrize("width", [70, 100, 1000])
def test_columns_stay_aligned_on_terminals_without_some_characters(encoding: str | None, width: int) -> None:
    """Each row's verdict begins where the heading's does, whatever its sentence is spelled with."""
    sentences = ["plain", "≤ 5 € or more", "α … β", "§§§", "a sentence that is long enough to be cut: " + "é" * 60]
    reports = [report(f"G{at}", statement=text, where=f"§{at}") for at, text in enumerate(sentences)]
    heading, *rows = verdict_table(reports, width, False, encoding).splitlines()
    begin = heading.index("verdict")
    mark = "+" if encoding else "✓"
    for row in rows[: len(reports)]:
        assert row.encode(encoding or "utf-8")
        assert cell_len(row[: row.index(f"{mark} supported")]) == begin


def test_columns_of_other_tables_stay_aligned_too(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", terminal)
    rows = [("§1 α", "1"), ("plain", "2")]
    PlainSpokenConsole(file=terminal, width=60).print_whole(plain_table(("claim …", "n"), rows))
    terminal.flush()
    lines = terminal.buffer.getvalue().decode("ascii").splitlines()
    assert [line.rstrip() for line in lines] == ["claim ...     n", "sec. 1 alpha  1", "plain         2"]
