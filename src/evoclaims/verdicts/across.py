"""The same claims in several environments: each verdict, and each claim's trials against those of the first."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from packaging.utils import canonicalize_name

from evoclaims.judging.drift_report import DriftReport, DriftRow
from evoclaims.judging.verdict import Outcome
from evoclaims.trials.result import TrialResult
from evoclaims.trials.store import Store
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.history import ordered
from evoclaims.verdicts.source_trials import SourceTrials
from evoclaims.verdicts.upgrade import Succession, Upgrade, upgrade

_Parts = frozenset[tuple[str, str]]
"""Conditions by label, each with a seed or a measure."""


@dataclass(frozen=True)
class Judged:
    """What came of one environment.

    Attributes:
        label: names it, such as "evosax 0.3.2".
        reports: the claims as they were judged there.
        trials: of each claim's conditions, by label of the condition.
        trouble: why there are no reports, in a line; else empty.
        notes: what else than the release on trial differs, in words.
    """

    label: str
    reports: Mapping[str, ClaimReport]
    trials: Mapping[str, tuple[TrialResult, ...]]
    trouble: str = ""
    notes: str = ""

    def outcome(self, claim: str) -> Outcome:
        """Return how a claim ended: "not run" if there is no such claim, as where its cases come from the package."""
        return self.reports[claim].outcome if claim in self.reports else Outcome.NOT_RUN

    def depends_on(self, package: str) -> bool:
        """Whether a judged trial depends on a package, whose other releases would else change nothing."""
        named = (name for report in self.reports.values() for source in report.sources for name in source.versions)
        return canonicalize_name(package) in map(canonicalize_name, named)


@dataclass(frozen=True)
class Cell:
    """One claim in one environment.

    Attributes:
        outcome: of its verdict there; "not run" if there is no such claim there.
        n: judged trials per side.
        was: its outcome in the first environment; None in that one itself.
        repeated: whether some of its trials were made anew, since they depend on what differs.
        compared: those of them that can be compared to the bit, by seed.
        changed: how many of these differ.
        drift: of what the drift check tested, the metric with the smallest p; None if it tested nothing.
        same: whether its trials are those of the first environment, since they depend on nothing that differs.
        without_bits: the trials that cannot be compared to the bit, by condition and seed; all of one without a seed.
        untested: what the drift check could not test, by condition and measure; all of one without a measure.
    """

    outcome: Outcome
    n: int
    was: Outcome | None = None
    repeated: bool = False
    compared: int = 0
    changed: int = 0
    drift: DriftRow | None = None
    same: bool = False
    without_bits: _Parts = frozenset()
    untested: _Parts = frozenset()

    @property
    def drifted(self) -> bool:
        """Whether its trials have drifted from those of the first environment."""
        return self.drift is not None and self.drift.drifted

    @property
    def verdict_changed(self) -> bool:
        """Whether its verdict is another one than in the first environment."""
        return self.was is not None and self.outcome is not self.was


@dataclass(frozen=True)
class Across:
    """Claims by environments.

    Attributes:
        environments: in the order in which they were asked for, also those without reports.
        claims: names, in natural order.
        cells: by claim and label of the environment.
        upgrades: the comparison with the first environment, by label.
    """

    environments: tuple[Judged, ...]
    claims: tuple[str, ...]
    cells: Mapping[tuple[str, str], Cell]
    upgrades: Mapping[str, Upgrade]

    @property
    def changed(self) -> dict[str, list[str]]:
        """Claims whose verdict changed or whose trials drifted, by label of the environment."""
        found: dict[str, list[str]] = {}
        for (claim, label), cell in self.cells.items():
            if cell.verdict_changed or cell.drifted:
                found.setdefault(label, []).append(claim)
        return found

    @property
    def without_verdicts(self) -> list[str]:
        """Labels of the environments that could not be made, or in which no claim could be judged."""
        return [one.label for one in self.environments if one.trouble]

    @property
    def broken(self) -> dict[str, list[str]]:
        """Claims that are errors, by label of the environment: nothing is known of them there."""
        found: dict[str, list[str]] = {}
        for (claim, label), cell in self.cells.items():
            if cell.outcome is Outcome.ERROR:
                found.setdefault(label, []).append(claim)
        return found

    @property
    def judged(self) -> bool:
        """Whether a claim was judged anywhere."""
        return any(cell.outcome.judged for cell in self.cells.values())

    @property
    def lines(self) -> list[str]:
        """What the table has no room for: troubles, what else differs, changed verdicts, and drift."""
        lines = []
        for one in self.environments:
            notes = filter(None, [one.trouble and f"no verdicts: {one.trouble}", one.notes])
            lines += [f"{one.label}: {note}" for note in notes]
            for claim in self.claims:
                cell = self.cells.get((claim, one.label))
                if cell is not None and cell.verdict_changed:
                    gone = "" if claim in one.reports else " (there is no such claim in it)"
                    lines.append(f"{one.label}: {claim}: {cell.was} -> {cell.outcome}{gone}")
            drift = self.upgrades[one.label].drift if one.label in self.upgrades else DriftReport((), 0)
            lines += [f"{one.label}: {line}" for line in drift.lines]
            if drift.nearest is not None and not drift.drifted:
                lines.append(f"{one.label}: {drift.undecided}")
        return lines


def judged(label: str, reports: Iterable[ClaimReport], store: Store, notes: str = "") -> Judged:
    """Return what came of an environment, with the trials that it judged.

    Args:
        label: names the environment.
        reports: its claims.
        store: the store that it used.
        notes: what else than the release on trial differs there.
    """
    by_name = {report.name: report for report in ordered(reports)}
    trials: dict[str, dict[str, TrialResult]] = {}
    for source in (source for report in by_name.values() for source in report.sources):
        for trial in _trials(source, store):
            trials.setdefault(source.label, {})[trial.id] = trial
    in_order_of_ids = {name: tuple(those[trial] for trial in sorted(those)) for name, those in trials.items()}
    return Judged(label, by_name, in_order_of_ids, notes=notes)


def across(environments: Sequence[Judged]) -> Across:
    """Compare every environment with the first that has verdicts; each is one family of tests for Holm's correction."""
    with_reports = [one for one in environments if one.reports]
    claims = dict.fromkeys(name for one in with_reports for name in one.reports)
    cells: dict[tuple[str, str], Cell] = {}
    upgrades: dict[str, Upgrade] = {}
    first = with_reports[0] if with_reports else None
    for one in with_reports:
        if first is not None and one is not first:
            upgrades[one.label] = upgrade(list(_successions(first, one)))
        for name in claims:
            cells[name, one.label] = _cell(name, one, None if one is first else first, upgrades.get(one.label))
    return Across(tuple(environments), tuple(claims), cells, upgrades)


def _trials(source: SourceTrials, store: Store) -> list[TrialResult]:
    """Return the trials of a condition that were made with the versions of the environment that judged it."""
    versions = {name: those[0] for name, those in source.versions.items() if those}
    made = (store.made_with(trial, versions) for trial in source.trials)
    return [trial for trial in made if trial is not None]


def _successions(first: Judged, now: Judged) -> Iterable[Succession]:
    """Yield the conditions that both environments have trials of, unless these are the same records."""
    versions = {
        judged.label: {source.label: source for report in judged.reports.values() for source in report.sources}
        for judged in (first, now)
    }
    for label, trials in now.trials.items():
        before, source = first.trials.get(label, ()), versions[now.label][label]
        old = versions[first.label].get(label)
        if not before or old is None or before == trials:
            continue
        was, is_now = ({name: those[0] for name, those in one.versions.items()} for one in (old, source))
        reads = {
            name
            for report in now.reports.values()
            for one in report.sources
            if one.label == label
            for name in one.reads
        }
        yield Succession(label, was, is_now, before, trials, len(trials), source.method, tuple(sorted(reads)))


def _cell(name: str, one: Judged, first: Judged | None, found: Upgrade | None) -> Cell:
    """Return the cell of a claim in an environment; `first` and `found` are None in the first one."""
    report = one.reports.get(name)
    cell = Cell(one.outcome(name), report.n if report else 0, first.outcome(name) if first else None)
    if first is None or found is None:
        return cell
    without_bits, untested = _uncompared(name, one, first, found)
    cell = replace(cell, without_bits=without_bits, untested=untested)
    if report is None:
        return cell
    labels = {source.label for source in report.sources}
    own = [one for one in found.successions if one.label in labels]
    rows = [row for row in found.drift.rows if row.label in labels and row.p_holm is not None]
    return replace(
        cell,
        repeated=bool(own),
        compared=sum(len(one.pairs) for one in own),
        changed=sum(one.changed for one in own),
        drift=min(rows, key=lambda row: (not row.drifted, row.p_holm, row.p or 1.0), default=None),
        same=bool(labels) and all(first.trials.get(label, ()) == one.trials.get(label) for label in labels),
    )


def _uncompared(name: str, one: Judged, first: Judged, found: Upgrade) -> tuple[_Parts, _Parts]:
    """Return what of a claim cannot be compared with the first environment: trials to the bit, measures for drift."""
    sources = [source for judged in (first, one) if name in judged.reports for source in judged.reports[name].sources]
    both = {own.label: own for own in found.successions}
    without_bits, untested = set[tuple[str, str]](), set[tuple[str, str]]()
    for label in {source.label for source in sources}:
        if label in both:
            compared = {new.seed for _, new in both[label].pairs}
            apart = {(label, str(trial.seed)) for trial in both[label].now if trial.seed not in compared}
            without_bits |= apart
            if apart or both[label].changed:  # the same bits need no test
                untested |= {(label, row.metric) for row in found.drift.unchecked if row.label == label}
        elif first.trials.get(label, ()) != one.trials.get(label, ()):  # only one of both has such trials
            without_bits.add((label, ""))
            untested.add((label, ""))
    return frozenset(without_bits), frozenset(untested)
