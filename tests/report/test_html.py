"""The page: all text escaped, nothing from outside, every name in it unique and every reference answered."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections import Counter
from dataclasses import replace
from html.parser import HTMLParser
from urllib.parse import unquote_to_bytes

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from laboratory import HERE, Laboratory, better_solves, better_wins
from unpacked import pieces, whole

from evoclaims.judging.verdict import Outcome
from evoclaims.report.formatting import clean, places
from evoclaims.report.html import data_uri, html
from evoclaims.report.model import Page, PaperFigure
from evoclaims.verdicts.claim_report import ClaimReport

HOSTILE = '</section><script>alert(1)</script><img src=x onerror="alert(2)">\'"&amp;{{ 7 * 7 }}\x00\ud800\u202e'


class Parsed(HTMLParser):
    """Tags with their attributes, and text, as a browser would read them."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str]]] = []
        self.text: list[str] = []
        self.feed(page)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, {name: value or "" for name, value in attrs}))

    def handle_data(self, data: str) -> None:
        self.text.append(data)

    def values(self, name: str) -> list[str]:
        """Return all values of an attribute."""
        return [attributes[name] for _, attributes in self.tags if name in attributes]


def _shape(page: str) -> list[tuple[str, list[str]]]:
    """Return all tags with the names of their attributes: what no text may change."""
    return [(tag, list(attributes)) for tag, attributes in Parsed(page).tags]


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> tuple[Laboratory, ClaimReport]:
    """A laboratory with a judged claim, for many pages."""
    lab = Laboratory(tmp_path_factory.mktemp("bench"))
    lab.put("better", [1.0, 0.9, 0.9, 0.8, 0.8, 0.7])
    lab.put("worse", [0.1, 0.2, 0.3, 0.3, 0.4, 0.5])
    return lab, lab.judge(better_wins, case="small")


def _page(lab: Laboratory, report: ClaimReport, text: str) -> Page:
    """Return a page in which a text stands wherever texts come from files."""
    assert report.verdict is not None
    (evidence,) = report.verdict.evidence
    samples = tuple(replace(sample, label=f"{sample.label} {text}") for sample in evidence.samples)
    parts = (replace(evidence, describe=text, detail=text, samples=samples),)
    verdict = replace(report.verdict, describe=text, evidence=parts)
    changed = replace(
        report,
        claim=f"T {text}",
        case=text,
        statement=text,
        where=f"§1 {text}",
        reason=text,
        because=text,
        expected=Outcome.SUPPORTED,
        verdict=verdict,
        sources=(replace(report.sources[0], method=f"better {text}"), report.sources[1]),
    )
    return lab.page(changed, sentences={changed.name: f"paper {text}"})


@pytest.fixture(scope="module")
def plain_shape(bench: tuple[Laboratory, ClaimReport]) -> list[tuple[str, list[str]]]:
    """What the page is made of whose text is a word."""
    return _shape(whole(_page(*bench, "plain")))


@settings(max_examples=40)  # each makes a whole page
@given(st.text(min_size=1).filter(lambda text: not places(text)[0].startswith("§")))  # sections are chosen by
def test_no_text_changes_what_the_page_is_made_of(
    bench: tuple[Laboratory, ClaimReport], plain_shape: list[tuple[str, list[str]]], text: str
) -> None:
    lab, report = bench
    shown = f"x{text}x"
    page = whole(_page(lab, report, shown))
    assert _shape(page) == plain_shape
    assert page.encode()


def test_a_hostile_sentence_is_shown_as_it_is(bench: tuple[Laboratory, ClaimReport]) -> None:
    page = whole(_page(*bench, HOSTILE))
    parsed = Parsed(page)
    shown = clean(HOSTILE)
    assert "alert(1)" in shown
    assert sum(shown in text for text in parsed.text) >= 5
    assert not [name for _, attributes in parsed.tags for name in attributes if name.startswith("on")]
    assert Counter(tag for tag, _ in parsed.tags)["script"] == 1
    assert "49" not in re.findall(r"\d+", "".join(text for text in parsed.text if "7 * 7" in text))
    assert not set(page) & set("\x00\ud800\u202e")


def test_the_trials_of_a_claim_that_was_not_judged_have_safe_names_too(bench: tuple[Laboratory, ClaimReport]) -> None:
    lab, report = bench
    hostile = replace(report.sources[0], method=HOSTILE)
    page = whole(lab.page(replace(report, verdict=None, sources=(hostile,))))
    assert "the trials at hand, not judged" in page
    assert clean(HOSTILE) in " ".join(Parsed(page).values("aria-label"))
    assert not set(page) & set("\x00\ud800\u202e")


def test_hostile_provenance_and_names_of_curves_are_escaped(lab: Laboratory) -> None:
    provenance = {
        **HERE,
        "versions": {HOSTILE: HOSTILE},
        "machine": HOSTILE,
        "device": {"kind": HOSTILE, "platform": HOSTILE},
        "git": {"sha": HOSTILE, "dirty": False},
        HOSTILE: [HOSTILE],
    }
    # A record is JSON, which has no place for half a character.
    sound = json.loads(json.dumps(provenance).replace("\\ud800", ""))
    curves = {"environment_steps": (1.0, 2.0), HOSTILE.replace("\ud800", ""): (0.0, 1.0)}
    lab.put("better", [1.0] * 6, provenance=sound, curves=curves)
    report = lab.judge(better_solves)
    parsed = Parsed(whole(lab.page(report)))
    assert Counter(tag for tag, _ in parsed.tags)["script"] == 1
    assert "img" not in dict(parsed.tags)
    assert sum("alert(1)" in text for text in parsed.text) >= 5


def test_the_policy_allows_this_script_and_this_style_alone(bench: tuple[Laboratory, ClaimReport]) -> None:
    page = html(bench[0].page(bench[1]))
    (policy,) = [a["content"] for _, a in Parsed(page).tags if a.get("http-equiv") == "Content-Security-Policy"]
    rules = dict(rule.split(" ", 1) for rule in policy.split("; "))
    assert rules["default-src"] == "'none'"
    assert rules["img-src"] == "data:"
    for tag in ("script", "style"):
        (text,) = re.findall(rf"<{tag}>(.*?)</{tag}>", page, flags=re.DOTALL)
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        assert rules[f"{tag}-src"] == f"'sha256-{digest}'"


def test_nothing_comes_from_outside(bench: tuple[Laboratory, ClaimReport]) -> None:
    figure = PaperFigure("Fig. 1", "says", b'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1 1"/>')
    parsed = Parsed(whole(bench[0].page(bench[1], figures=[figure])))
    addresses = [value for name in ("src", "href", "action", "srcset", "data") for value in parsed.values(name)]
    assert len(addresses) >= 5
    assert all(address.startswith(("#", "data:")) for address in addresses)
    assert not parsed.values("style")


def test_ids_are_unique_and_every_reference_has_its_place(filled: Laboratory) -> None:
    reports = [filled.judge(better_wins, tier=tier, id=name) for tier in ("full", "smoke") for name in ("A1", "A1")]
    parsed = Parsed(whole(filled.page(*reports)))
    ids = parsed.values("id")
    assert len(ids) == len(set(ids))
    assert {"A1-full", "A1-full-2", "A1-smoke", "A1-smoke-2"} <= set(ids)
    references = [value[1:] for value in parsed.values("href") if value.startswith("#")]
    assert set(references) | set(parsed.values("aria-labelledby")) <= set(ids)


def test_verdicts_are_words_and_symbols_besides_colours(filled: Laboratory) -> None:
    page = html(filled.page(filled.judge(better_wins)))
    parsed = Parsed(page)
    (chip,) = [attributes for tag, attributes in parsed.tags if attributes.get("class", "").startswith("chip ")]
    assert chip["href"] == "#T1-full"
    text = " ".join(" ".join(parsed.text).split())
    assert "✓ T1, supported (full)" in text
    assert "1 ✓ supported 0 ✗ refuted 0 ? inconclusive 0 E error 0 - not run" in text


def test_an_empty_report_says_so_and_has_no_filters(lab: Laboratory) -> None:
    parsed = Parsed(html(lab.page()))
    assert "There are no claims to report on." in parsed.text
    assert "form" not in dict(parsed.tags)


def test_what_claims_share_is_packed_once(filled: Laboratory) -> None:
    reports = [filled.judge(better_wins, id=f"T{i}") for i in range(5)]
    page = filled.page(*reports)
    found = pieces(html(page))
    for kind in ("trials", "settings"):
        assert [name for name in found if name.startswith(f"{kind} ")] == [f"{kind} 0", f"{kind} 1"]
    for index in range(5):
        assert Parsed(found[f"T{index}-full"]).values("data-piece") == [
            "trials 0",
            "trials 1",
            "settings 0",
            "settings 1",
        ]


def test_every_place_has_its_piece_and_every_piece_its_place(filled: Laboratory) -> None:
    figure = PaperFigure("Fig. 1", "says", b'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1 1"/>')
    page = filled.page(filled.judge(better_wins), filled.judge(better_wins, tier="smoke"), figures=[figure])
    assert set(Parsed(whole(page)).values("data-piece")) == set(pieces(html(page)))


def test_the_same_page_is_the_same_text(filled: Laboratory) -> None:
    page = filled.page(filled.judge(better_wins))
    assert html(page) == html(page)


def test_a_picture_is_an_address_of_its_own_text() -> None:
    svg = '<svg xmlns="http://www.w3.org/2000/svg"><text x="{}">100.1234 % #1 "ä"</text><path d="M 1.{} 2"/></svg>'
    kind, _, text = data_uri(svg.format("3.456789", "23456").encode()).partition(",")
    assert kind == "data:image/svg+xml"
    assert not set(text) & set('"<>#ä\n')
    assert unquote_to_bytes(text) == svg.format("3.45", "23").encode()
