"""Why a verdict may differ from the accepted one: a change in what is computed, or new draws of the same experiment."""

from __future__ import annotations

from evoclaims.judging.drift_report import DriftReport
from evoclaims.judging.tripwire import DigestCheck
from evoclaims.verdicts.acceptance import changes
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.history import AcceptedVerdict


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
    seen += f"; but trials of the same method have drifted: {', '.join(elsewhere)}" if elsewhere else ""
    ps = f" (p was {old.p:.2g}, and is {new.p:.2g})" if old.p is not None and new.p is not None else ""
    return (
        f"its trials are other draws{by}{seen}. With {new.n} trials a side a verdict near its bound can fall either "
        f"way by chance{ps}; `--claims-trials N` looks at more"
    )
