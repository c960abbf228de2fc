"""The verdicts of a run against those last accepted, and why one may differ: another computation, or new draws."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from evoclaims.core.errors import UserError
from evoclaims.judging.drift_report import DigestCheck, DriftReport
from evoclaims.judging.verdict import Outcome
from evoclaims.verdicts import history, transitions
from evoclaims.verdicts.acceptance import changes
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.history import AcceptedVerdict, key_of
from evoclaims.verdicts.transitions import Kind, Pattern, Transition

LOST: Final = Pattern(Outcome.SUPPORTED, Outcome.INCONCLUSIVE)

SELDOM: Final = 0.01
"""Share of draws up to which a lost support is no chance."""


@dataclass(frozen=True)
class Regression:
    """How the verdicts of a run's claims have changed.

    Attributes:
        transitions: one for each claim of the run, and for each that is gone; empty if nothing has been accepted yet.
        matched: those that make the run fail.
        accepted: the last accepted verdict of each claim.
        chances: of each claim that lost its support to *inconclusive*, how often that happens by chance (see
            `ClaimReport.chance`).
    """

    transitions: tuple[Transition, ...]
    matched: tuple[Transition, ...]
    accepted: Mapping[tuple[str, str], AcceptedVerdict]
    chances: Mapping[tuple[str, str], float | None] = field(default_factory=dict)

    @property
    def changed(self) -> dict[tuple[str, str], AcceptedVerdict]:
        """The accepted verdicts that differ from the run's, by tier and claim."""
        keys = [(one.tier, one.claim) for one in self.transitions if one.kind is Kind.CHANGED]
        return {key: self.accepted[key] for key in keys}

    @property
    def names(self) -> list[str]:
        """What is changed or gone, such as "G1 (smoke)"."""
        gone = [f"{one.claim} ({one.tier}), gone" for one in self.transitions if one.kind is Kind.GONE]
        return [*(f"{claim} ({tier})" for tier, claim in self.changed), *gone]

    def lines(self, reasons: Mapping[tuple[str, str], str]) -> list[str]:
        """Return the counts, and a line for each verdict that differs from the accepted one; empty without any.

        Changed verdicts have their `reasons` behind them, by tier and claim.
        """
        if not self.transitions:
            return []
        shown = (Kind.CHANGED, Kind.NEW_HISTORY, Kind.GONE)
        changes = [one for one in self.transitions if one.kind in shown]
        return [
            f"against the accepted verdicts: {transitions.counts(self.transitions)}",
            *(
                f"{'REGRESSION ' * (one in self.matched)}{transitions.describe(one)}"
                + (f": {reasons[one.tier, one.claim]}" if (one.tier, one.claim) in reasons else "")
                + self._by_chance(one)
                for one in changes
            ),
        ]

    def _by_chance(self, transition: Transition) -> str:
        """Say how often a claim loses its support by chance, if it did."""
        key = transition.tier, transition.claim
        if key not in self.chances:
            return ""
        chance = self.chances[key]
        if chance is None:
            return "; how often this happens by chance is not known without pilots (`evoclaims power --run` makes them)"
        return f"; by chance this happens in {chance:.1%} of draws from its pilots"


def regression(
    folder: Path,
    reports: Sequence[ClaimReport],
    changes: str | None,
    collected: Collection[tuple[str, str]] | None = None,
) -> Regression:
    """Compare the verdicts of a run with the accepted ones of the same claims.

    Args:
        folder: of the reproduction.
        reports: of the run.
        changes: the changes of verdicts to fail on (see `transitions.parse_patterns`); None for none. Where there are
            some, support that is lost to *inconclusive* fails, too, unless it happens by chance in more than `SELDOM`
            of the draws from the claim's pilots.
        collected: tier and name of all claims that there are at the run's tiers, if that is known: accepted verdicts
            of others are about claims that are gone.

    Raises:
        UserError: when the accepted verdicts are damaged, or missing although the run should fail on their changes.
    """
    path = folder / history.FILE
    patterns = transitions.parse_patterns(changes) if changes is not None else ()
    kept = history.load(path)
    accepted = transitions.accepted(kept)
    if patterns and not accepted:
        raise UserError(
            f"There are no accepted verdicts to compare with, since {path} does not exist: "
            "`evoclaims accept` writes it."
        )
    if not accepted:
        return Regression((), (), {})
    now = transitions.standings(reports)
    tiers = {tier for tier, _ in now}
    gone = {key for key in accepted if collected is not None and key[0] in tiers and key not in collected}
    found = transitions.compare({key: accepted[key] for key in accepted.keys() & (now.keys() | gone)}, now)
    last = {key: entries[-1] for key, entries in kept.items() if key in now}
    lost = {(one.tier, one.claim) for one in found if LOST.matches(one)}
    chances = {key_of(report): report.chance for report in reports if key_of(report) in lost}
    failing = transitions.matched(found, patterns)
    if patterns:
        rare = {key for key, chance in chances.items() if chance is None or chance <= SELDOM}
        failing = tuple(one for one in found if one in failing or (one.tier, one.claim) in rare)
    return Regression(found, failing, last, chances)


def reason(
    report: ClaimReport,
    old: AcceptedVerdict,
    new: AcceptedVerdict,
    drift: DriftReport,
    digests: DigestCheck,
    upgraded: DriftReport | None = None,
) -> str:
    """Return in a sentence why a claim's verdict may have changed.

    Args:
        report: of the claim, as it is now.
        old: its accepted verdict, of the same fingerprint.
        new: the current verdict.
        drift: the comparison of its trials, among others, with the reference trials.
        digests: the comparison to the bit of those that the same kind of machine made with the same versions.
        upgraded: the comparison of its trials, among others, with stored ones of other versions, as `across` makes it.
    """
    if old.trials == new.trials:
        return "from the same trials to the bit, so that the code which judges or reads them has changed"
    labels = {f"{source.label} ({report.tier})" for source in report.sources}
    mine = drift.about(labels)
    for found, those in ((upgraded, "those of other versions"), (drift, "the reference trials")):
        drifted = sorted({row.label for row in found.about(labels).rows if row.drifted}) if found else []
        if drifted:
            return f"the trials of {', '.join(drifted)} have drifted from {those} (see above)"
    if {change.condition for change in digests.changed} & {source.condition for source in report.sources}:
        return (
            "the same seeds gave other trials with the same versions on a machine of the same name: the code which "
            "runs them has changed, or its processor is another one, which records of older releases do not tell"
        )
    moved = ", ".join([*changes(old, new), *([f"n {old.n} -> {new.n}"] if old.n != new.n else [])])
    by = f" ({moved})" if moved else ""
    checked = upgraded.about(labels) if upgraded and upgraded.about(labels).nearest else mine
    methods = sorted({source.method for source in report.sources})
    elsewhere = sorted(
        {
            row.label
            for found in (upgraded, drift)
            for row in (found.rows if found else ())
            if row.drifted and row.label.partition(" on ")[0] in methods
        }
    )
    seen = f"; {checked.undecided}" if checked.nearest else "; whether they drifted is not known"
    if any(row.status == "not repeated" for row in mine.rows):
        seen = "; trials with fresh seeds have not shown their drift again (see above)"
    seen += f"; but trials of the same method have drifted: {', '.join(elsewhere)}" if elsewhere else ""
    ps = f" (p was {old.p:.2g}, and is {new.p:.2g})" if old.p is not None and new.p is not None else ""
    return (
        f"its trials are other draws{by}{seen}. With {new.n} trials a side a verdict near its bound can fall either "
        f"way by chance{ps}; `--claims-trials N` looks at more"
    )
