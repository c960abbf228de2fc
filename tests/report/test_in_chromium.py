"""The page in a real browser: no complaints, no requests, filters by hand and by address, every image."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from chromium import NAMES, Chromium, found
from laboratory import Laboratory, better_solves, better_wins

from evoclaims.report.html import html
from evoclaims.report.model import PaperFigure
from evoclaims.verdicts.claim_report import Tally
from evoclaims.verdicts.transitions import Robustness

PLATE = (
    b'<svg xmlns="http://www.w3.org/2000/svg" width="40" height="30" viewBox="0 0 40 30">'
    b'<style>rect{fill:#123}</style><rect width="40" height="30" style="stroke:red"/></svg>'
)
HOSTILE = "<img src=x onerror=\"document.title='broken in'\"><script>document.title='broken in'</script>"

pytestmark = pytest.mark.skipif(
    found() is None,
    reason=f"no Chromium here: none of {', '.join(NAMES)} is on the path (Debian: apt install chromium)",
)


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chromium]:
    """A browser for the whole module."""
    program = found()
    assert program is not None
    started = Chromium(program, tmp_path_factory.mktemp("profile"))
    yield started
    started.close()


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A report with claims of every end, at both tiers, with a figure and hostile texts."""
    folder = tmp_path_factory.mktemp("paper")
    lab = Laboratory(folder)
    lab.put("better", [1.0, 1.0, 1.0, 0.8, float("nan"), 1.0])
    lab.put("worse", [0.1, 0.2, 0.3, 0.3, 0.4, 0.5])
    lab.put("neat", [1.0] * 6)

    def neat_wins(group: Any) -> Any:
        return group("neat").mean_success > group("worse").mean_success

    def neat_loses(group: Any) -> Any:
        return group("worse").mean_success > group("neat").mean_success

    def missing(group: Any) -> Any:
        return group("better").solves_level(0).in_most_trials()

    claims = [
        ("G1", neat_wins, "§5.1"),
        ("G2", neat_loses, "§5.1"),
        ("S1", better_wins, "§5.2"),
        ("S2", missing, "§5.2"),
    ]
    reports = [
        lab.judge(
            claim, tier=tier, id=name, where=where, says=f"The sentence of {name} {HOSTILE}", smoke=f"{name} small"
        )
        for tier in ("full", "smoke")
        for name, claim, where in claims
    ]
    empty = Laboratory(folder / "empty")
    reports.append(empty.judge(better_solves, id="C1", where="control"))
    sentences = {report.name: report.statement for report in reports if report.tier == "full"}
    page = lab.page(*reports, figures=[PaperFigure("Fig. 3", "says", PLATE)], sentences=sentences)
    row = Robustness("G1", "full", Tally.SUPPORTED, {"network": Tally.REFUTED})
    page = replace(page, robustness=(row,), variants={"network": "another network"})
    path = folder / "index.html"
    path.write_text(html(page), encoding="utf-8")
    return path.as_uri()


def _visible(browser: Chromium) -> list[str]:
    """Return the ids of the claims whose verdicts are seen in the lines that the page opens with."""
    shown: list[str] = browser.evaluate(
        "[...document.querySelectorAll('.chip:not(.faint)')].filter(s => s.checkVisibility()).map(s => s.dataset.for)"
    )
    return shown


def _open_all(browser: Chromium) -> None:
    """Open everything that can be opened, and wait until it is unpacked."""
    for _ in range(3):  # what is unpacked has parts that open, too
        browser.evaluate("document.querySelectorAll('details').forEach(one => { one.open = true })")
        browser.evaluate("new Promise(done => setTimeout(done, 50))")


ALL = ["G1-full", "G1-smoke", "G2-full", "G2-smoke", "S1-full", "S1-smoke", "S2-full", "S2-smoke", "C1-full"]


def test_the_page_loads_without_a_complaint_or_a_request(browser: Chromium, address: str) -> None:
    browser.open(address)
    assert browser.complaints == []
    assert [request for request in browser.requests if not request.startswith("data:")] == [address]
    assert _visible(browser) == ALL
    assert browser.evaluate("document.getElementById('shown').textContent") == "9 of 9 claims"


def test_the_page_opens_with_a_line_for_each_sentence_and_evidence_is_unpacked_on_demand(
    browser: Chromium, address: str
) -> None:
    shown = "[...document.querySelectorAll('.claim')].filter(s => s.querySelector('.parts')?.checkVisibility())"
    browser.open(address)
    assert browser.evaluate("[...document.querySelectorAll('.entry .id')].map(one => one.textContent)") == [
        *("G1", "G2", "S1", "S2", "C1")
    ]
    assert browser.evaluate("document.querySelectorAll('.entry').length") == 5
    assert browser.evaluate("document.querySelectorAll('.parts, .curves, .settings').length") == 0
    assert browser.evaluate("[...document.querySelectorAll('.claim')].some(s => s.checkVisibility())") is False
    browser.evaluate("document.querySelectorAll('.entry > summary')[2].click()")
    browser.evaluate("document.querySelector('#S1-full summary').click()")
    browser.evaluate("location.hash = '#G1-full'")
    assert browser.evaluate(f"new Promise(done => setTimeout(() => done({shown}.map(s => s.id)), 50))") == [
        "G1-full",
        "S1-full",
    ]
    browser.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert browser.evaluate(f"{shown}.length") == 8  # C1 has no trials
    assert browser.evaluate("[...document.querySelectorAll('.evidence')].every(one => one.open)")


def test_without_a_script_the_sentences_verdicts_and_reasons_are_there_and_the_evidence_is_said_to_be_packed(
    browser: Chromium, address: str
) -> None:
    browser.send("Emulation.setScriptExecutionDisabled", value=True)
    try:
        browser.open(f"{address}#G1-full")
    finally:
        browser.send("Emulation.setScriptExecutionDisabled", value=False)
    assert "status --as json" in browser.evaluate("document.querySelector('noscript').textContent")
    assert browser.evaluate("document.querySelector('noscript').checkVisibility()")
    assert browser.evaluate("document.querySelector('#G1-full .reason').checkVisibility()")
    assert browser.evaluate("document.querySelector('#unpackable').checkVisibility()") is False


def test_a_page_whose_pieces_are_damaged_says_so(browser: Chromium, address: str, tmp_path: Path) -> None:
    text = Path(urlsplit(address).path).read_text(encoding="utf-8")
    torn = tmp_path / "torn.html"
    torn.write_text(text.replace('<template id="pieces">', '<template id="pieces">AAAA'), encoding="utf-8")
    browser.open(torn.as_uri())
    assert browser.evaluate("new Promise(done => setTimeout(done, 50))") is None
    assert browser.evaluate("document.querySelector('#unpackable').checkVisibility()")


def test_every_image_loads(browser: Chromium, address: str) -> None:
    browser.open(f"{address}#figures")
    _open_all(browser)
    images = browser.evaluate(
        """Promise.all([...document.images].map(
          (image) => image.decode().then(() => [image.className, image.complete, image.naturalWidth])
        ))"""
    )
    assert [name for name, *_ in images] == [""]
    assert all(complete and width > 0 for _, complete, width in images)
    assert images[-1] == ["", True, 40]


@pytest.mark.parametrize(
    ("query", "expected"),
    [
        ("verdict=supported", ["G1-full", "G1-smoke"]),
        ("verdict=refuted&verdict=error", ["G2-full", "G2-smoke", "S1-full", "S1-smoke"]),
        ("verdict=not+run", ["C1-full"]),
        ("tier=smoke&section=%C2%A75.2", ["S1-smoke", "S2-smoke"]),
        ("section=control", ["C1-full"]),
        ("method=neat&tier=full", ["G1-full", "G2-full"]),
        ("words=SENTENCE+g2", ["G2-full", "G2-smoke"]),
        ("words=g2+small", ["G2-smoke"]),
        ("words=no+such+words", []),
    ],
)
def test_the_address_sets_the_filters(browser: Chromium, address: str, query: str, expected: list[str]) -> None:
    browser.open(f"{address}#?{query}")
    assert _visible(browser) == expected
    assert browser.evaluate("document.getElementById('nothing').checkVisibility()") is (not expected)
    faint = browser.evaluate("document.querySelectorAll('.chip.faint').length")
    assert faint == len(ALL) - len(expected)
    assert browser.complaints == []


def test_filters_work_by_keyboard_and_are_kept_in_the_address(browser: Chromium, address: str) -> None:
    browser.open(address)
    for wanted in ("document.activeElement.matches('.choose > summary')", "document.activeElement.value === 'refuted'"):
        for _ in range(40):
            browser.press("Tab", "Tab", 9)
            if browser.evaluate(wanted):
                break
        if "summary" in wanted:
            browser.press("Enter", "Enter", 13, "\r")
    browser.press(" ", "Space", 32, " ")
    assert _visible(browser) == ["G2-full", "G2-smoke"]
    assert browser.evaluate("location.hash") == "#?verdict=refuted"
    browser.evaluate("document.querySelector('[type=search]').focus()")
    for letter in "small":
        browser.press(letter, f"Key{letter.upper()}", ord(letter.upper()), letter)
    assert _visible(browser) == ["G2-smoke"]
    assert browser.evaluate("location.hash") == "#?verdict=refuted&words=small"
    browser.press("Tab", "Tab", 9)
    browser.press("Enter", "Enter", 13, "\r")
    assert browser.evaluate("new Promise(done => setTimeout(() => done(location.hash), 50))") == ""
    assert _visible(browser) == ALL


def test_sentences_are_whole_at_1280_pixels_and_variants_are_shown_on_demand(browser: Chromium, address: str) -> None:
    browser.open(address, width=1280)
    cut = "[...document.querySelectorAll('.entry .sentence')].filter(one => one.scrollWidth > one.clientWidth).length"
    assert browser.evaluate(cut) == 0
    assert browser.evaluate("document.querySelector('.entry .sentence').getBoundingClientRect().width") > 400
    seen = "[...document.querySelectorAll('.columns .variant')].filter(one => one.checkVisibility()).length"
    assert browser.evaluate(seen) == 0
    browser.evaluate("document.querySelector('.choose').open = true; document.getElementById('variants').click()")
    assert browser.evaluate(seen) == 1


def test_a_link_to_a_claim_shows_it_whatever_the_filters_say(browser: Chromium, address: str) -> None:
    browser.open(f"{address}#?verdict=refuted")
    browser.evaluate("document.querySelector('[data-for=S2-smoke]').click()")
    browser.evaluate("new Promise(done => setTimeout(done, 50))")
    assert "S2-smoke" in _visible(browser)
    top = browser.evaluate("document.getElementById('S2-smoke').getBoundingClientRect().top")
    assert 0 <= top < 900
    browser.evaluate(
        "new Promise(done => { addEventListener('hashchange', () => setTimeout(done, 50)); history.back() })"
    )
    assert _visible(browser) == ["G2-full", "G2-smoke"]


@pytest.mark.parametrize(("width", "dark"), [(320, False), (320, True), (1280, False)])
def test_the_page_fits_its_window_and_follows_the_colour_scheme(
    browser: Chromium, address: str, width: int, dark: bool
) -> None:
    browser.open(address, width=width, dark=dark)
    assert browser.evaluate("document.documentElement.scrollWidth") <= width
    _open_all(browser)
    assert browser.evaluate("document.documentElement.scrollWidth") <= width
    paper, ink = browser.evaluate(
        "['backgroundColor', 'color'].map(name => Number(getComputedStyle(document.body)[name].match(/\\d+/)[0]))"
    )
    assert (ink > paper + 100) if dark else (paper > ink + 100)
    assert browser.complaints == []
