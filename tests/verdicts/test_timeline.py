"""Accepted verdicts by date, with what changed behind them."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree

from evoclaims.judging.verdict import Outcome
from evoclaims.report.across import timeline_chart
from evoclaims.report.verdict_chart import svg
from evoclaims.verdicts.acceptance import described
from evoclaims.verdicts.history import AcceptedVerdict

SVG = "{http://www.w3.org/2000/svg}"
VERSIONS = {"jax": "0.10.2", "python": "3.11.7", "numpy": "2.4"}
FIRST = AcceptedVerdict(
    Outcome.SUPPORTED,
    "p = 0.0282 <= alpha = 0.04 at n = 10",
    10,
    0.0282,
    "f" * 64,
    "2025-01-02",
    VERSIONS,
    "cpu",
    "a" * 40,
    "d" * 64,
)


def test_an_entry_says_what_has_changed_since_the_one_before() -> None:
    second = replace(
        FIRST,
        outcome=Outcome.REFUTED,
        reason="p = 0.00865 against it <= alpha = 0.04 at n = 10",
        accepted="2025-03-04",
        versions={**VERSIONS, "jax": "0.11.2"},
        device="NVIDIA H200",
        revision=f"{'b' * 40}-dirty",
    )
    assert described(None, FIRST) == (
        "2025-01-02  supported (n = 10: p = 0.0282 <= alpha = 0.04)  python 3.11.7, jax 0.10.2, cpu"
    )
    assert described(FIRST, second) == (
        "2025-03-04  refuted (n = 10: p = 0.00865 against it <= alpha = 0.04)  jax 0.10.2 -> 0.11.2, "
        "device cpu -> NVIDIA H200, revision aaaaaaaaaaaa -> bbbbbbbbbbbb-dirty"
    )


def test_a_chart_has_a_column_for_each_date_and_set_of_versions_and_a_ring_where_the_rules_changed() -> None:
    second = replace(FIRST, outcome=Outcome.REFUTED, versions={**VERSIONS, "numpy": "2.5"})
    third = replace(second, accepted="2025-05-06", fingerprint="e" * 64)
    drawing = ElementTree.fromstring(
        svg(timeline_chart({("full", "G1"): (FIRST, second, third), ("full", "G2"): (FIRST,)}))
    )
    texts = [text.text for text in drawing.iter(f"{SVG}text")]
    assert [text for text in texts if text and text.startswith("2025")] == ["2025-01-02"] * 2 + ["2025-05-06"]
    assert texts.count("jax 0.10.2") == 3
    marks = [mark for mark in drawing.iter(f"{SVG}circle") if mark.find(f"{SVG}title") is not None]
    assert len({mark.attrib["cx"] for mark in marks}) == 3
    assert [mark.attrib["cx"] for mark in marks].count(marks[0].attrib["cx"]) == 2  # both claims' first verdicts
    assert len([mark for mark in drawing.iter(f"{SVG}circle") if mark.attrib["fill"] == "none"]) == 1
