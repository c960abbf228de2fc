"""A session over a project's claims: its reproduction, its store, and the judging of one claim after another."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from evoclaims.core.errors import UserError
from evoclaims.judging.assertion import Assertion
from evoclaims.judging.baseline import DriftReport
from evoclaims.judging.fingerprint import fingerprint
from evoclaims.judging.judge import judge
from evoclaims.judging.protocol import Look, Protocol
from evoclaims.judging.tripwire import DigestCheck
from evoclaims.judging.verdict import Outcome, Verdict
from evoclaims.suite import references
from evoclaims.suite.claim import Claim
from evoclaims.suite.group import Fetch, TrialGroup
from evoclaims.suite.modes import NotStoredError
from evoclaims.suite.report import ClaimReport, judged
from evoclaims.suite.reproduction import Reproduction
from evoclaims.trials.store import Store


@dataclass(frozen=True)
class Session:
    """What claims are judged with.

    Attributes:
        reproduction: the paper under test.
        store: where trials are kept.
        fetch: how trials are had.
        trials: a fixed number of trials in place of the tier's looks; None keeps the tier's protocol.
    """

    reproduction: Reproduction
    store: Store
    fetch: Fetch
    trials: int | None = None

    def group(self, method: str, on: str, tier: str) -> TrialGroup:
        """Return the trials of a method on a task, not yet run."""
        return TrialGroup(method, on, self.reproduction.tier(tier).condition(method, on), self.fetch)

    def protocol(self, tier: str) -> Protocol:
        """Return how claims of a tier are judged; with a fixed number of trials, by one look at the whole α."""
        protocol = self.reproduction.tier(tier).protocol
        if self.trials is None:
            return protocol
        return replace(protocol, looks=(Look(self.trials, protocol.alpha),))

    def settle(self, claim: Claim, case: str, tier: str, assertion: Assertion) -> ClaimReport:
        """Judge an assertion; trials that may not be run make the verdict "not run"."""
        protocol = self.protocol(tier)
        name = f"{claim.id}[{case}]" if case else claim.id
        try:
            verdict = judge(assertion, protocol, claim=name, tier=tier)
        except NotStoredError as error:
            mark = fingerprint(assertion, protocol, claim=name, tier=tier)
            verdict = Verdict(Outcome.NOT_RUN, str(error), assertion.describe(), mark)
        return judged(claim, case, tier, assertion, protocol, verdict)

    def drift(self, reports: Sequence[ClaimReport]) -> tuple[DriftReport, DigestCheck]:
        """Compare the trials behind `reports` with the committed reference trials of their tiers."""
        used: dict[tuple[str, str, str], set[str]] = {}
        for report in reports:
            for source in report.sources:
                used.setdefault((report.tier, source["method"], source["task"]), set()).update(source["trials"])
        cases = []
        for (tier, method, task), ids in sorted(used.items()):
            trials = [trial for trial in map(self.store.get, sorted(ids)) if trial is not None]
            if trials:
                folder = self.reproduction.references
                cases.append(references.drift_case(folder, tier, method, task, trials))
        return references.compare(cases)


class Verdicts:
    """The `verdict` fixture: takes exactly one assertion per test and keeps what became of it."""

    def __init__(self, settle: Callable[[Assertion], ClaimReport]) -> None:
        """Remember how to judge."""
        self._settle = settle
        self.report: ClaimReport | None = None

    def __call__(self, assertion: Assertion) -> None:
        """Judge the claim's assertion.

        Raises:
            UserError: for a second assertion, or something that is none.
        """
        if not isinstance(assertion, Assertion):
            raise UserError(
                f"verdict(...) takes an assertion about trials, such as verdict(a.mean_success > b.mean_success), "
                f"not {assertion!r}."
            )
        if self.report is not None:
            raise UserError("A claim has one verdict: join several assertions with & (and) or | (or).")
        self.report = self._settle(assertion)
