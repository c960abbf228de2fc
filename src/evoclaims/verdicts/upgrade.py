"""What other versions of packages have changed: trials of this environment compared with those of earlier ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from evoclaims.core.packages import Versions, agree, recorded
from evoclaims.core.printable import printable
from evoclaims.core.provenance import same_bits
from evoclaims.judging.drift import DriftCase, check_drift
from evoclaims.judging.drift_report import DriftReport
from evoclaims.paper import references
from evoclaims.trials.result import TrialResult
from evoclaims.trials.store import newest
from evoclaims.verdicts import source_trials


def _in_time(trials: Sequence[TrialResult]) -> tuple[TrialResult, ...]:
    """Return the trials that did not run out of time: nothing is known of others."""
    return tuple(trial for trial in trials if trial.status != "timeout")


@dataclass(frozen=True)
class Succession:
    """A condition with stored trials of this environment and of an older one with other versions.

    Attributes:
        label: names the condition.
        old, new: versions of the packages that it depends on.
        before, now: its trials, of the newest older environment and of this one.
        again: how many trials this run repeated because of their versions.
        method: what its conditions share.
        reads: what claims read of each trial.
    """

    label: str
    old: Versions
    new: Versions
    before: tuple[TrialResult, ...]
    now: tuple[TrialResult, ...]
    again: int
    method: str = ""
    reads: tuple[str, ...] = ()

    @property
    def change(self) -> str:
        """Which versions differ, in words."""
        return source_trials.change(self.old, self.new)

    @property
    def pairs(self) -> list[tuple[TrialResult, TrialResult]]:
        """Old and new trials of the same seed that differ only in versions, and both came to an end."""
        now = {trial.seed: trial for trial in _in_time(self.now)}
        both = [(old, now[old.seed]) for old in _in_time(self.before) if old.seed in now]
        return [(old, new) for old, new in both if same_bits(old.provenance, new.provenance, but="versions")]

    @property
    def changed(self) -> int:
        """How many of these pairs differ in their digests."""
        return sum(old.digest != new.digest for old, new in self.pairs)


@dataclass(frozen=True)
class Upgrade:
    """All conditions of a run that also have trials of an older environment, judged together for drift."""

    successions: tuple[Succession, ...]
    drift: DriftReport

    @property
    def again(self) -> int:
        """Trials that this run repeated because of their versions."""
        return sum(one.again for one in self.successions)

    @property
    def drifted(self) -> list[str]:
        """The conditions that this run repeated and that have drifted; later runs report them but do not fail."""
        drifted = {row.label for row in self.drift.rows if row.drifted}
        return [one.label for one in self.successions if one.again and one.label in drifted]

    @property
    def lines(self) -> list[str]:
        """What changed, which conditions were run again, how many trials differ, and what drifted how far."""
        lines: list[str] = []
        for change in dict.fromkeys(one.change for one in self.successions):
            those = [one for one in self.successions if one.change == change]
            lines.append(f"versions changed: {change}")
            lines += [f"  {_line(one)}" for one in those]
            labels = [one.label for one in those]
            drift = self.drift.about(labels)
            drifted = sum(row.drifted for row in drift.rows)
            lines += [f"  {line}" for line in drift.lines]
            lines.append(f"  {drift.tested} comparisons with the trials made before, {drifted} drifted")
            if not drifted and drift.nearest is not None:
                lines.append(f"  {drift.undecided}")
        return [printable(line) for line in lines]

    def to_json(self) -> dict[str, Any]:
        """Return what happened as strict JSON."""
        conditions = [
            {
                "condition": one.label,
                "old": dict(one.old),
                "new": dict(one.new),
                "again": one.again,
                "compared": len(one.pairs),
                "changed": one.changed,
            }
            for one in self.successions
        ]
        return {"conditions": conditions, "drift": self.drift.to_json()}


def upgrade(successions: Sequence[Succession]) -> Upgrade:
    """Check all successions for drift, with one correction over all: nothing else can have changed."""
    cases = [
        DriftCase(
            one.label,
            one.now[0].condition,
            _in_time(one.now),
            _in_time(one.before),
            references.measures(one.now, one.reads),
            method=one.method,
        )
        for one in successions
    ]
    return Upgrade(tuple(successions), check_drift(cases))


def predecessors(records: Sequence[TrialResult], packages: tuple[str, ...]) -> tuple[TrialResult, ...]:
    """Return the records made by the newest environment.

    Args:
        records: of trials of one condition, made with other versions than this environment's.
        packages: what the condition depends on.
    """
    last = newest(records)
    if last is None:
        return ()
    made_with = recorded(last.provenance, packages)
    return tuple(record for record in records if agree(record.provenance, made_with))


def _line(one: Succession) -> str:
    ran = f"{one.again} trials run again" if one.again else "run again before"
    pairs = one.pairs
    if not pairs:
        return (
            f"{one.label}: {ran}, none of which can be compared to the bit (another machine or device, or out of time)"
        )
    return f"{one.label}: {ran}, {one.changed} of {len(pairs)} not the same to the bit as before"
