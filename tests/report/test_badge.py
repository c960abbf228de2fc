"""Badges: well-formed, with every text as it stands, in a colour that says how it is."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import pytest
from hand_made_verdicts import report
from hypothesis import given
from hypothesis import strategies as st

from evoclaims.report.badge import BLUE, GREEN, GREY, RED, colour_of, message_of, svg
from evoclaims.verdicts.claim_report import CONTROL, ClaimReport

SVG = "{http://www.w3.org/2000/svg}"


def _reports(*outcomes: str, expected: str | None = None) -> list[ClaimReport]:
    return [report("G1", outcome, expected=expected) for outcome in outcomes]


def test_a_badge_shows_label_and_message_and_nothing_from_elsewhere() -> None:
    text = svg("claims", "supported 24 / refuted 5", "#123456")
    root = ElementTree.fromstring(text)
    assert [element.text for element in root.iter(f"{SVG}text")] == ["claims", "supported 24 / refuted 5"]
    assert root.find(f"{SVG}title").text == "claims: supported 24 / refuted 5"  # type: ignore[union-attr]
    assert root.get("aria-label") == "claims: supported 24 / refuted 5"
    assert root.find(f"{SVG}rect").get("fill") == "#123456"  # type: ignore[union-attr]
    assert re.findall(r"https?://[^\"]+", text) == ["http://www.w3.org/2000/svg"]


def test_texts_stay_within_their_halves() -> None:
    root = ElementTree.fromstring(svg("claims (smoke)", "supported 24 / refuted 5 / inconclusive 2", "#123456"))
    label, message = root.iter(f"{SVG}text")
    starts = [float(one.get("x")) for one in (label, message)]  # type: ignore[arg-type]
    lengths = [float(one.get("textLength")) for one in (label, message)]  # type: ignore[arg-type]
    edge = float(re.match(r"M3 0h(\d+)v", root.find(f"{SVG}path").get("d"))[1]) + 3  # type: ignore[index,union-attr,arg-type]
    assert starts[0] + lengths[0] <= edge <= starts[1]
    assert starts[1] + lengths[1] <= float(root.get("width"))  # type: ignore[arg-type]


@given(
    st.text(st.characters(exclude_categories=()), max_size=20),
    st.text(st.characters(exclude_categories=()), max_size=20),
    st.text(max_size=9),
)
def test_any_text_gives_a_well_formed_picture_that_shows_it(label: str, message: str, colour: str) -> None:
    text = svg(label, message, colour.strip("\x00") if colour.isprintable() else BLUE)
    root = ElementTree.fromstring(text.encode())
    assert len(list(root.iter())) == 7
    if message.isprintable():
        assert (list(root.iter(f"{SVG}text"))[1].text or "") == " ".join(message.split())


def test_a_colour_cannot_leave_its_place() -> None:
    root = ElementTree.fromstring(svg("a", "b", '"/><script>'))
    assert root.find(f"{SVG}rect").get("fill") == '"/><script>'  # type: ignore[union-attr]


def test_the_message_counts_outcomes_in_their_usual_order() -> None:
    assert message_of(_reports("refuted", "supported", "inconclusive", "supported")) == (
        "supported 2 / refuted 1 / inconclusive 1"
    )
    assert message_of([]) == "no claims"


def test_the_message_counts_controls_of_the_benchmark_apart_from_the_papers_claims() -> None:
    both = [*_reports("refuted", "supported"), report("C1", "supported", where=CONTROL)]
    assert message_of(both) == "supported 1 / refuted 1; controls: supported 1"


@pytest.mark.parametrize(
    ("outcomes", "expected", "colour"),
    [
        (("supported", "supported"), None, GREEN),
        (("supported", "inconclusive"), None, BLUE),
        (("supported", "not run"), None, BLUE),
        (("supported", "refuted"), None, RED),
        (("refuted", "refuted"), "refuted", BLUE),
        (("supported", "error"), None, RED),
        (("not run", "not run"), None, GREY),
        ((), None, GREY),
    ],
)
def test_the_colour_says_whether_something_failed(outcomes: tuple[str, ...], expected: str | None, colour: str) -> None:
    assert colour_of(_reports(*outcomes, expected=expected)) == colour
