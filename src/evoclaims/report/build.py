"""Build a report's data from verdicts, trials and the history of accepted verdicts."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from evoclaims.judging.design import Design
from evoclaims.judging.verdict import Outcome
from evoclaims.paper.archive import Archive
from evoclaims.paper.reproduction import Reproduction
from evoclaims.report import audit, replication_cells, table_cells, training_curves, trial_summary
from evoclaims.report.evidence import Part, judged_parts, unjudged_part
from evoclaims.report.formatting import Anchors, clean, listed, places, plural
from evoclaims.report.model import Board, ConditionTrials, Page, Section, fault_grid
from evoclaims.report.trial_summary import Reader, TrialSummary
from evoclaims.verdicts import other_code
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.history import AcceptedVerdict, History, eras, key_of
from evoclaims.verdicts.mutation_matrix import Matrix, described
from evoclaims.verdicts.readings import by_reading
from evoclaims.verdicts.source_trials import SourceTrials

Verdicts = Mapping[str, Sequence[ClaimReport]]
"""Reports by tier, in the order in which tiers are shown."""


def gather(
    reproduction: Reproduction,
    verdicts: Verdicts,
    archive: Archive,
    history: History,
    *,
    sentences: Mapping[str, str],
    put_to_the_paper: Sequence[ClaimReport] = (),
    mutants: Matrix | None = None,
) -> Page:
    """Return a report's data on verdicts; what else a page shows is its caller's to add.

    Args:
        reproduction: the paper under test.
        verdicts: reports of its claims.
        archive: source of trials; each is read once.
        history: accepted verdicts.
        sentences: the paper's own sentences by claim, such as "G1[n_parity]".
        put_to_the_paper: reports of claims that were judged from the paper's own numbers.
        mutants: the committed matrix of planted faults; None for none.
    """
    tried, reader = mutants or {}, Reader(archive)
    failing = {
        (report.tier, report.name): replication_cells.would_not_pass(report)
        for report in put_to_the_paper
        if replication_cells.is_decided(report) and report.outcome is not Outcome.SUPPORTED
    }
    gathered = _Gathering(reproduction, reader, history, sentences, failing, tried)
    boards = tuple(
        Board(tier, tuple(gathered.section(report) for report in table_cells.in_the_papers_order(reports)))
        for tier, reports in verdicts.items()
    )
    return Page(
        title=reproduction.title,
        name=reproduction.name,
        boards=boards,
        conditions=gathered.conditions,
        notices=tuple(_notices(boards, reader)),
        variants={name: variant.says for name, variant in reproduction.variants.items()},
        put_to_the_paper=tuple(replication_cells.put_to_the_paper(put_to_the_paper)),
        faults=tuple(fault_grid(tried, tier, reports) for tier, reports in verdicts.items() if reports),
    )


def _notices(boards: Sequence[Board], reader: Reader) -> list[str]:
    sections = [section for board in boards for section in board.sections]
    notices = []
    if not sections:
        notices.append("There are no claims to report on.")
    elif all(section.report.outcome is Outcome.NOT_RUN for section in sections):
        notices.append(
            "No claim has been judged: neither the store nor the committed reference trials hold the trials that the "
            "claims need. `pytest -m smoke` runs those of the smoke tier."
        )
    notices += reader.troubles
    errors = [section.report for section in sections if section.report.outcome is Outcome.ERROR]
    reasons = dict.fromkeys(report.reason for report in errors)
    if errors:
        notices.append(f"{plural(len(errors), 'claim')} ended in error. {listed(reasons, most=3)}")
    return notices


@dataclass(frozen=True)
class _Gathering:
    """What a report's sections share while it is built: what `gather` was given, and what has been read so far."""

    reproduction: Reproduction
    reader: Reader
    history: History
    sentences: Mapping[str, str]
    failing: Mapping[tuple[str, str], str]
    mutants: Matrix
    anchors: Anchors = field(default_factory=Anchors)
    conditions: dict[str, ConditionTrials] = field(default_factory=dict)

    def section(self, report: ClaimReport) -> Section:
        """Return one claim's section."""
        read = {source.label: self.reader.read(source.trials, source.installed) for source in report.sources}
        every = [trial for trials in read.values() for trial in trials]
        made = Counter(trial.origin for trial in every)
        sentence = self.sentences.get(report.name, "")
        entries = self.history.get(key_of(report), ())
        tier = self.reproduction.tiers.get(report.tier)
        failing = self.failing.get((report.tier, report.name))
        over = report.verdict.overspent if report.verdict else ""
        return Section(
            report=report,
            anchor=self.anchors.new(report.claim, report.case, report.tier),
            methods=tuple(dict.fromkeys(clean(source.method) for source in report.sources)),
            places=places(report.where),
            paper=sentence if sentence != report.statement else "",
            design="" if tier is None else _in_words(tier.design),
            parts=_parts(report, read),
            conditions=tuple(self._condition(source) for source in report.sources if source.trials),
            made=made,
            warnings=(
                *_broken(every),
                *trial_summary.warnings(made),
                *_edited(report),
                *([f"Over budget: {over}."] if over else []),
                *filter(None, [failing]),
            ),
            history=eras(entries),
            change=_change(entries, report),
            faults=described(self.mutants, report) if report.n else "",
            nulls=audit.nulls(report, self.reproduction.null_agents),
            read=by_reading(report.readings),
            power=table_cells.power(report),
        )

    def _condition(self, source: SourceTrials) -> str:
        """Return the key of a condition with this number of trials, after gathering its data."""
        key = f"{source.condition}-{len(source.trials)}"
        if key not in self.conditions:
            trials = self.reader.read(source.trials, source.installed)
            panels, rest = training_curves.panels(trials)
            settings = _flat(self.reader.settings.get(source.condition, {}))
            says = f"{plural(len(trials), 'trial')}. {rest}".strip()
            self.conditions[key] = ConditionTrials(source.label, says, settings, panels)
        return key


def _parts(report: ClaimReport, read: Mapping[str, Sequence[TrialSummary]]) -> tuple[Part, ...]:
    """Return the evidence; without it, only the trials."""
    if report.verdict is not None and report.verdict.evidence:
        return judged_parts(report.verdict)
    return tuple(unjudged_part(label, trials) for label, trials in read.items() if trials)


def _edited(report: ClaimReport) -> list[str]:
    """Return a sentence for each method or task that was edited after trials of a claim had run."""
    lines = [clean(other_code.summary(name)) for name in other_code.edited(report)]
    return [f"{words[0].upper()}{words[1:]}." for words in lines]


def _change(entries: Sequence[AcceptedVerdict], report: ClaimReport) -> str:
    """Say what differs from the last accepted verdict; empty if there is nothing to say."""
    if not entries or report.verdict is None or not report.outcome.judged:
        return ""
    last = entries[-1]
    if last.fingerprint != report.fingerprint:
        return f"What was fixed beforehand has changed since {last.accepted}: a new history begins."
    if last.outcome != report.outcome:
        return f"Accepted on {last.accepted} as {last.outcome}; now {report.outcome}."
    return ""


ENDINGS: Final = {
    "crashed": "crashed, so that the claim is an error",
    "diverged": "diverged and count as the worst result",
    "timeout": "ran out of time, with results that are unknown and decide nothing",
}
"""What became of trials without a result, by their status."""


def _broken(trials: Sequence[TrialSummary]) -> tuple[str, ...]:
    """Say which trials have no valid result."""
    found = []
    for status, ended in ENDINGS.items():
        if failed := [trial for trial in trials if trial.status == status]:
            seeds = listed(dict.fromkeys(trial.seed_in_words for trial in sorted(failed, key=lambda one: one.seed)))
            found.append(f"{len(failed)} of {plural(len(trials), 'trial')} {ended} (seeds {seeds}).")
    without = [t for t in trials if t.status == "done" and t.score is not None and math.isnan(t.score)]
    if without:
        found.append(f"The mean success of finished trials is NaN (seeds {listed(t.seed_in_words for t in without)}).")
    return tuple(found)


def _in_words(design: Design) -> str:
    looks = ", then ".join(f"{look.n} trials a side at α = {look.alpha:g}" for look in design.looks)
    return (
        f"Looks at {looks}; seeds from {design.first_seed} up; p0 = {design.p0:g} for “most trials”; "
        f"A12 margin {design.a12_margin:g}."
    )


def _flat(plain: Mapping[str, Any], prefix: str = "") -> tuple[tuple[str, str], ...]:
    """Return nested settings as rows: "method.parameters.sigma" becomes "method sigma"."""
    rows: list[tuple[str, str]] = []
    for key, value in plain.items():
        name = f"{prefix} {clean(key)}".strip() if key != "parameters" else prefix
        if isinstance(value, dict) and value:
            rows += _flat(value, name)
        else:
            rows.append((name, _setting(value)))
    return tuple(rows)


def _setting(value: Any) -> str:
    if isinstance(value, list):
        return listed(map(_setting, value), most=20) or "none"
    return "–" if value is None else clean(value)
