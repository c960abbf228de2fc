"""Claims and accepted outcomes: what they must say, and which acceptance holds."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from evoclaims import Outcome, claim, expected
from evoclaims.claims.claim import TIER, Claim, ClaimTest, Expectation, claim_of, expectation_of, gap_of
from evoclaims.claims.report_making import expecting, unjudged
from evoclaims.core.errors import UserError
from evoclaims.verdicts.claim_report import ClaimReport, save

TEXTS = {"says": "So it is", "where": "§1", "smoke": "So it is, in small"}


class Item:
    """Stands for a pytest item with marks, the closest first."""

    def __init__(self, *marks: Any) -> None:
        self.marks = [getattr(mark, "mark", mark) for mark in marks]

    def get_closest_marker(self, name: str) -> Any:
        return next((mark for mark in self.marks if mark.name == name), None)


def test_a_claim_is_attached_to_its_test() -> None:
    @claim("T1", **TEXTS)
    def test_it() -> None: ...

    found = claim_of(Item(*test_it.pytestmark))  # type: ignore[arg-type,attr-defined]
    assert found == Claim("T1", **TEXTS)
    assert claim_of(Item()) is None  # type: ignore[arg-type]
    assert (found.statement("smoke"), found.statement("full")) == (TEXTS["smoke"], TEXTS["says"])


@pytest.mark.parametrize("word", ["id", "says", "where", "smoke"])
@pytest.mark.parametrize(
    ("given", "said"), [("  ", "lacks its {}"), (1, "has 1 as its {}, which is not text. Write it in quotes")]
)
def test_a_text_that_is_lacking_or_none_is_named(word: str, given: Any, said: str) -> None:
    texts: dict[str, Any] = {"id": "T1", **TEXTS, word: given}
    with pytest.raises(UserError, match=said.format(word)):
        claim(texts.pop("id"), **texts)


def test_an_accepted_outcome_must_be_known_and_have_a_reason() -> None:
    with pytest.raises(UserError, match="The outcome 'rejected' does not exist. Use one of supported, refuted"):
        expected("rejected", because="it is")
    with pytest.raises(UserError, match=r"An expected outcome \(refuted\) lacks its reason\. Write because="):
        expected(Outcome.REFUTED, because=" ")
    with pytest.raises(UserError, match=r"An expected outcome \(refuted\) lacks its reason\. Write because="):
        claim("T1", **TEXTS, expect=Outcome.REFUTED)


def test_a_claim_without_a_smoke_test_says_why_and_keeps_its_sentence() -> None:
    texts = {**TEXTS, "smoke": None}
    with pytest.raises(UserError, match="without a smoke test needs because="):
        claim("T1", **texts)
    with pytest.raises(UserError, match="accept the outcome with @expected"):
        claim("T1", **texts, expect=Outcome.REFUTED, because="it is")

    @claim("T1", **texts, because="nothing so small shows it")
    def test_it() -> None: ...

    item: Any = Item(*test_it.pytestmark)  # type: ignore[attr-defined]
    found = claim_of(item)
    assert found is not None
    assert found.statement("smoke") == TEXTS["says"]
    assert (gap_of(item, "smoke"), gap_of(item, "full")) == ("nothing so small shows it", "")


CLAIMS = """
    import pytest
    from evoclaims import claim
    from evoclaims import expected

    TEXTS = {"says": "So it is", "where": "§1", "smoke": "So it is, in small"}
    pytestmark = expected("error", because="module")

    @pytest.mark.parametrize("task", ["plain", pytest.param("marked", marks=expected("refuted", because="case"))])
    @claim("wide", **TEXTS, expect="inconclusive", because="claim")
    def test_wide(task, verdict): ...

    @pytest.mark.parametrize("task", ["plain", pytest.param("marked", marks=expected("refuted", because="case"))])
    @expected("inconclusive", because="claim, full", tier="full")
    @claim("fine", **TEXTS)
    def test_fine(task, verdict): ...

    @pytest.mark.parametrize(
        "task",
        [
            pytest.param(
                "both",
                marks=[expected("refuted", because="every tier"), expected("error", because="full", tier="full")],
            ),
            pytest.param("other", marks=expected("refuted", because="full alone", tier="full")),
        ],
    )
    @expected("supported", because="claim")
    @claim("tiers", **TEXTS)
    def test_tiers(task, verdict): ...

    @expected("error", because="every tier")
    @expected("refuted", because="full", tier="full")
    @claim("above", **TEXTS)
    def test_above(verdict): ...

    @expected("refuted", because="full", tier="full")
    @expected("error", because="every tier")
    @claim("below", **TEXTS)
    def test_below(verdict): ...
"""

CLOSEST = {
    "wide plain": ("claim", "claim"),
    "wide marked": ("case", "case"),
    "fine plain": ("module", "claim, full"),
    "fine marked": ("case", "case"),
    "tiers both": ("every tier", "full"),
    "tiers other": ("claim", "full alone"),
    "above": ("every tier", "full"),
    "below": ("every tier", "full"),
}


def test_the_closest_acceptance_holds_and_beside_it_the_one_for_the_tier_alone(pytester: pytest.Pytester) -> None:
    items, _ = pytester.inline_genitems(pytester.makepyfile(CLAIMS), "-pno:cacheprovider")
    found = {}
    for item in (item for item in items if item.callspec.params[TIER] == "full"):  # type: ignore[attr-defined]
        name = " ".join([item.originalname.removeprefix("test_"), *filter(None, [item.callspec.params.get("task")])])  # type: ignore[attr-defined]
        found[name] = tuple(getattr(expectation_of(item, tier), "because", None) for tier in ("smoke", "full"))
    assert found == CLOSEST


def test_without_an_acceptance_for_its_tier_a_test_has_none(pytester: pytest.Pytester) -> None:
    text = CLAIMS.replace('pytestmark = expected("error", because="module")', "")
    items, _ = pytester.inline_genitems(pytester.makepyfile(text), "-pno:cacheprovider")
    (item,) = (item for item in items if item.name == "test_fine[plain-fine-full]")
    assert expectation_of(item, "smoke") is None
    assert expectation_of(item, "full") == Expectation(Outcome.INCONCLUSIVE, "claim, full", "full")


REPORT = unjudged(ClaimTest(Claim("T1", **TEXTS), "smoke", "n_parity"), Outcome.ERROR, "it broke")


@pytest.mark.parametrize(
    ("outcome", "accepted", "failed"),
    [
        ("supported", None, False),
        ("inconclusive", None, False),
        ("not run", None, False),
        ("refuted", None, True),
        ("error", None, True),
        ("refuted", Outcome.REFUTED, False),
        ("error", Outcome.REFUTED, True),
        ("supported", Outcome.REFUTED, False),
    ],
)
def test_a_claim_fails_when_it_is_refuted_or_breaks_without_being_accepted(
    outcome: str, accepted: Outcome | None, failed: bool
) -> None:
    expectation = None if accepted is None else Expectation(accepted, "known")
    report = expecting(replace(REPORT, outcome=Outcome(outcome)), expectation)
    assert report.failed is failed
    assert report.as_expected is (accepted == outcome)


@pytest.mark.parametrize("case", ["n_parity", "../../etc", "a b/c", "", "é[x]"])
def test_the_evidence_lies_below_the_store_under_a_plain_name(case: str, tmp_path: Path) -> None:
    saved = save(replace(REPORT, case=case), tmp_path)
    path = Path(saved.evidence)
    assert path.parent == tmp_path / "verdicts" / "smoke"
    assert ClaimReport.from_json(json.loads(path.read_text())) == saved


def test_an_outcome_is_expected_at_a_tier_that_there_is() -> None:
    with pytest.raises(UserError, match="There is no tier named 'smok'. Did you mean 'smoke'"):
        expected("refuted", because="seen", tier="smok")
