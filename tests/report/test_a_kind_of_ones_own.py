"""A kind of assertion is one file: judged, fingerprinted and shown everywhere without a change elsewhere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from laboratory import Laboratory
from unpacked import whole

from evoclaims.judging.assertion import Assertion, Finding
from evoclaims.judging.design import Design
from evoclaims.judging.exact import sign_test
from evoclaims.judging.reading import NumberReading
from evoclaims.judging.sample import Trials
from evoclaims.judging.verdict import Bound, PValues
from evoclaims.report.run_summary import run_summary
from evoclaims.report.terminal_table import verdict_table
from evoclaims.verdicts.claim_report import ClaimReport


@dataclass(frozen=True)
class AtLeast(Assertion):
    """The median is at least a number: a one-sided sign test each way."""

    measure: NumberReading
    least: float
    kind: ClassVar[str] = "at least"

    def describe(self) -> str:
        return f"the median of {self.measure.describe()} is at least {self.least:g}"

    def attainable(self, n: int, design: Design) -> PValues:
        return PValues(sign_test(n, n).p, sign_test(n, n).p)

    def find(self, trials: Trials, design: Design, alpha: float) -> Finding:
        sample = self.measure.sample(trials)
        n, k = len(sample.values), sum(value >= self.least for value in sample.values)
        p = PValues(sign_test(k, n).p, sign_test(n - k, n).p)
        return self.found(p, self.attainable(n, design), alpha, (sample,), bounds=(Bound("least", self.least),))


def test_a_new_kind_is_judged_and_shown_in_every_form(filled: Laboratory) -> None:
    supported = filled.judge(lambda group: AtLeast(group("better").mean_success, 0.6))
    refuted = filled.judge(lambda group: AtLeast(group("worse").mean_success, 0.6), id="T2")
    assert (supported.outcome, refuted.outcome) == ("supported", "refuted")
    assert supported.fingerprint != filled.judge(lambda group: AtLeast(group("better").mean_success, 0.7)).fingerprint
    assert [source.label for source in supported.sources] == ["better on small"]
    assert ClaimReport.from_json(refuted.to_json()) == refuted
    page = filled.page(supported, refuted)
    assert [bound.value for bound in page.sections[1].parts[0].bounds] == [0.6]
    for text in (verdict_table([refuted], 160, False), run_summary([refuted])):
        assert "against 0.016" in text
    shown = whole(page)
    assert "the median of better on small: mean success over levels is at least 0.6" in shown
    assert "least: 0.6" in shown
    assert "<dt>p against the claim</dt><dd>0.016</dd>" in shown
