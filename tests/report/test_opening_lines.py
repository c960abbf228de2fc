"""What the page opens with: one line a sentence, its verdicts on every reading, and small pictures of the trials."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree

from laboratory import Laboratory, better_solves, better_wins

from evoclaims.judging.verdict import Bound, Outcome
from evoclaims.report.charts import SPARK_WIDTH as WIDTH
from evoclaims.report.charts import spark_svg
from evoclaims.report.evidence import Dot, Part, Strip
from evoclaims.report.html import findings, opening_lines
from evoclaims.verdicts.claim_report import ClaimReport, Tally
from evoclaims.verdicts.transitions import Robustness


def _part(*samples: list[float], **changes: object) -> Part:
    strips = tuple(Strip("x", tuple(Dot(i, v) for i, v in enumerate(values)), (), None) for values in samples)
    return replace(Part("a", None, (), "", False, strips), **changes)  # type: ignore[arg-type]


def _paths(*parts: Part) -> dict[str, list[str]]:
    """Return the drawn paths by their class."""
    found: dict[str, list[str]] = {}
    for path in ElementTree.fromstring(spark_svg(parts)).iter("path"):
        found.setdefault(path.get("class", ""), []).append(path.get("d", ""))
    return found


def test_a_sentence_has_one_line_with_its_cases_at_every_tier(filled: Laboratory) -> None:
    reports = [
        filled.judge(better_wins, tier=tier, case=case, id="T1", says="Better wins", smoke="Better wins in small")
        for tier in ("full", "smoke")
        for case in ("a", "b")
    ]
    other = filled.judge(better_solves, id="T2", says="Better solves")
    page = filled.page(*reports, other, sentences={"T1[a]": "Better wins", "T1[b]": "Better wins"})
    first, second = opening_lines(page)
    assert (first.claim, first.sentence, first.place) == ("T1", "Better wins", "§1.2")
    assert [section.report.name for section in first.at("smoke")] == ["T1[a]", "T1[b]"]
    assert len(first.cases) == 4
    assert (second.claim, second.place, len(second.cases)) == ("T2", "", 1)


def test_a_line_tells_what_came_of_each_case_under_each_variant(filled: Laboratory) -> None:
    page = filled.page(filled.judge(better_wins), filled.judge(better_solves, id="T2"))
    row = Robustness("T1", "full", Tally.SUPPORTED, {"network": Tally.REFUTED, "rows": Tally.SUPPORTED})
    shown = replace(page, robustness=(row,), variants={"network": "x", "rows": "y", "z": "z"})
    first, second = opening_lines(shown)
    assert list(map(shown.protocols, page.sections)) == ["refuted under network; supported under rows", ""]
    assert first.variants == {"network": (row,), "rows": (row,)}
    assert second.variants == {"network": (), "rows": ()}


def test_findings_count_sentences_whose_cases_end_alike_at_the_papers_tier(filled: Laboratory) -> None:
    def one(name: str, *outcomes: Outcome, tier: str = "full", where: str = "§1.2") -> list[ClaimReport]:
        judged = filled.judge(better_wins, tier=tier, id=name, says=f"Sentence {name}", where=where)
        return [
            replace(judged, case=str(case), outcome=outcome, verdict=None, asserts=f"{name} {case}")
            for case, outcome in enumerate(outcomes)
        ]

    good, bad, unrun = Outcome.SUPPORTED, Outcome.REFUTED, Outcome.NOT_RUN
    reports = [
        *one("T1", good, good),
        *one("T2", good, unrun),
        *one("T3", good, bad),
        *one("T4", bad),
        *one("T5", unrun),
        replace(one("T6", good)[0], asserts="T1 1"),  # the same result as T1[1], which decides it
        replace(one("T7", good)[0], satisfied_by=("no action",)),
    ]
    said = {"T3[1]": "a second sentence of one claim"}
    page = filled.page(*reports, *one("C1", good, where="control"), *one("T5", good, tier="smoke"), sentences=said)
    found = findings(page, opening_lines(page))
    assert [(one.says, [line.claim for line in one.lines]) for one in found] == [
        ("1 of 6 sentences (full): supported in every case", ["T1"]),
        ("1 of 6 sentences (full): supported but vacuous in every case", ["T7"]),
        ("1 of 6 sentences (full): refuted in every case", ["T4"]),
        ("1 of 6 sentences (full): not run in every case", ["T5"]),
        ("2 of 6 sentences (full): cases end differently", ["T2", "T3"]),
    ]
    only = filled.page(*one("T5", good, tier="smoke"))
    (finding,) = findings(only, opening_lines(only))
    assert finding.says == "1 of 1 sentence (smoke): supported in every case"
    assert findings(filled.page(), []) == []


def test_the_trials_of_the_part_that_decided_are_a_row_of_dots_each() -> None:
    found = _paths(_part([0.0, 1.0]), _part([0.0, 0.5, 1.0], [0.5], bounds=(Bound("low", 0.5),), decided=True))
    upper, lower = found["trials"]
    assert upper == "M2.5 3.5h0M18 3.5h0M33.5 3.5h0"
    assert lower == "M18 10.5h0"
    assert found["compared"] == ["M18 0V14"]


def test_an_event_is_a_bar_as_long_as_the_share_of_trials_in_which_it_holds() -> None:
    assert _paths(_part([1.0, 0.0, 1.0, 0.0], event=True)) == {"all": ["M2.5 7.0h31"], "held": ["M2.5 7.0h15.5"]}


def test_many_samples_are_their_medians() -> None:
    many = _part(*[[0.5]] * 9)
    medians = replace(many, strips=tuple(replace(strip, median=0.5) for strip in many.strips))
    assert len(_paths(medians)["trials"]) == 9


def test_without_trials_there_is_no_picture() -> None:
    assert spark_svg(()) == spark_svg((_part([]),)) == ""
    assert all(0 <= float(place[1:].split()[0]) <= WIDTH for place in _paths(_part([-1e308, 1e308]))["trials"])
