"""Sets of verdicts compared: what stayed and what changed; and which conclusions depend on a detail of the protocol."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final

from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.core.printable import printable
from evoclaims.judging.verdict import Outcome
from evoclaims.verdicts.claim_report import ClaimReport, Tally, Tried
from evoclaims.verdicts.history import History, in_order, key_of

ANY: Final = "*"
ARROW: Final = "->"


class Kind(StrEnum):
    """How a claim's verdict changed; the values complete "12 …" in a line of counts."""

    SAME = "the same"
    CHANGED = "changed"
    NEW_HISTORY = "under changed rules"
    NEW = "new"
    NOT_RUN = "not run, then or now"
    GONE = "gone"


@dataclass(frozen=True)
class Standing:
    """The compared parts of a verdict.

    Attributes:
        outcome: how the claim ended.
        fingerprint: hash of what was fixed beforehand; empty for a test that ended before its claim was known.
    """

    outcome: Outcome
    fingerprint: str


Standings = Mapping[tuple[str, str], Standing]
"""Verdicts by tier and claim."""


@dataclass(frozen=True)
class Transition:
    """One claim's old and new verdict at one tier; None without one."""

    tier: str
    claim: str
    kind: Kind
    old: Standing | None
    new: Standing | None


@dataclass(frozen=True)
class Pattern:
    """A change of verdict to look for; None stands for every outcome. A claim that is gone counts as not run."""

    old: Outcome | None
    new: Outcome | None

    def matches(self, transition: Transition) -> bool:
        """Whether a transition is such a change; False if the verdicts cannot be compared."""
        if transition.kind not in (Kind.CHANGED, Kind.GONE) or transition.old is None:
            return False
        new = transition.new.outcome if transition.new else Outcome.NOT_RUN
        return self.old in (None, transition.old.outcome) and self.new in (None, new)


def parse_patterns(text: str) -> tuple[Pattern, ...]:
    """Return the patterns in a list such as "supported->refuted,*->error".

    Raises:
        UserError: for an empty list, an invalid pattern, or one that changes nothing.
        UnknownNameError: for an unknown outcome.
    """
    patterns = []
    for part in filter(None, (part.strip() for part in text.split(","))):
        sides = [side.strip() for side in part.split(ARROW)]
        if len(sides) != 2:
            raise UserError(
                f"{part!r} is not a change of a verdict. Write OLD{ARROW}NEW, such as 'supported{ARROW}refuted' or "
                f"'{ANY}{ARROW}refuted', and commas between several."
            )
        for side in sides:
            if side != ANY and side not in set(Outcome):
                raise UnknownNameError("outcome", side, (*map(str, Outcome), ANY))
        old, new = (None if side == ANY else Outcome(side) for side in sides)
        if old is not None and old == new:
            raise UserError(f"{part!r} never happens: a verdict that stays {old} has not changed.")
        patterns.append(Pattern(old, new))
    if not patterns:
        raise UserError(f"No change of a verdict is named. Write one such as 'supported{ARROW}refuted'.")
    return tuple(patterns)


def matched(transitions: Iterable[Transition], patterns: Sequence[Pattern]) -> tuple[Transition, ...]:
    """Return the transitions that some pattern matches."""
    return tuple(one for one in transitions if any(pattern.matches(one) for pattern in patterns))


def standings(reports: Iterable[ClaimReport]) -> Standings:
    """Return the current verdicts."""
    return {key_of(r): Standing(r.outcome, r.fingerprint) for r in reports}


def accepted(history: History) -> Standings:
    """Return the last accepted verdicts."""
    return {key: Standing(entries[-1].outcome, entries[-1].fingerprint) for key, entries in history.items()}


def compare(old: Standings, new: Standings) -> tuple[Transition, ...]:
    """Return a transition for every claim of either side, in natural order (G9 before G10)."""
    keys = sorted(old.keys() | new.keys(), key=in_order)
    return tuple(Transition(*key, _kind(old.get(key), new.get(key)), old.get(key), new.get(key)) for key in keys)


def _kind(old: Standing | None, new: Standing | None) -> Kind:
    """Return how a verdict changed; an unknown fingerprint counts as unchanged."""
    if new is not None and new.outcome is Outcome.NOT_RUN and (old is None or old.outcome is Outcome.NOT_RUN):
        return Kind.NOT_RUN
    if old is None:
        return Kind.NEW
    if new is None:
        return Kind.GONE
    if old.fingerprint != new.fingerprint and old.fingerprint and new.fingerprint:
        return Kind.NEW_HISTORY
    return Kind.SAME if old.outcome == new.outcome else Kind.CHANGED


def counts(transitions: Sequence[Transition]) -> str:
    """Return the number of verdicts by kind, such as "22 the same, 1 changed"."""
    found = Counter(one.kind for one in transitions)
    return ", ".join(f"{found[kind]} {kind}" for kind in Kind if found[kind]) or "no verdicts"


def describe(transition: Transition) -> str:
    """Return a transition in one line, without terminal control characters."""
    change = _change(transition.old, transition.new, transition.kind)
    return f"{printable(transition.claim)} ({printable(transition.tier)}): {change}"


def _change(old: Standing | None, new: Standing | None, kind: Kind) -> str:
    if old is None or new is None:
        return f"{new.outcome}, new" if new else f"gone; it was {old.outcome}" if old else "no verdict"
    if kind is Kind.NEW_HISTORY:
        return (
            f"a new history begins, since what is judged has changed (fingerprint {old.fingerprint[:12]} {ARROW} "
            f"{new.fingerprint[:12]}): {new.outcome} now, {old.outcome} under the old rules"
        )
    return f"{old.outcome} {ARROW} {new.outcome}" if kind is Kind.CHANGED else str(new.outcome)


@dataclass(frozen=True)
class Robustness:
    """One claim under the protocol and its variants.

    Attributes:
        claim: id and parameters, such as "G1[n_parity]".
        tier: "smoke" or "full".
        plain: what the claim counts as under the protocol itself, apart from being insensitive.
        outcomes: the same by variant. No faults are planted there: a claim that notices one under the protocol is not
            vacuous. A variant that changes none of the claim's trials, or whose trials have not run, is left out.
        fewer: variants that are inconclusive with fewer trials than have decided the protocol's verdict, or where
            trials of either ran out of time: that may be for want of trials.
    """

    claim: str
    tier: str
    plain: Tally
    outcomes: Mapping[str, Tally]
    fewer: frozenset[str] = frozenset()

    @property
    def hangs_on(self) -> tuple[str, ...]:
        """Variants whose verdict is another one than the protocol's, and not for want of trials alone.

        None where the protocol itself has not run.
        """
        if self.plain is Tally.NOT_RUN:
            return ()
        return tuple(name for name, one in self.outcomes.items() if one != self.plain and name not in self.fewer)


def matrix(plain: Sequence[ClaimReport], variants: Mapping[str, Sequence[ClaimReport]]) -> tuple[Robustness, ...]:
    """Return a row for each claim that some variant touches, from reports under the protocol itself and by variant."""
    found = {
        (report.tier, report.name, name): report
        for name, reports in variants.items()
        for report in reports
        if report.outcome != Outcome.NOT_RUN
    }
    rows = []
    for report in plain:
        varied = {name: found[key] for name in variants if (key := (report.tier, report.name, name)) in found}
        undecided = {name: one.n for name, one in varied.items() if one.outcome is Outcome.INCONCLUSIVE}
        fewer = {name for name, n in undecided.items() if report.outcome is not Outcome.INCONCLUSIVE and n < report.n}
        fewer |= {name for name, one in varied.items() if report.wants_time or one.wants_time}
        outcomes = {name: _counted(one, report.tried) for name, one in varied.items()}
        counted = _counted(report, report.tried)
        rows.append(Robustness(report.name, report.tier, counted, outcomes, frozenset(fewer)))
    return tuple(row for row in rows if row.outcomes)


def _counted(report: ClaimReport, tried: Tried) -> Tally:
    return Tally.VACUOUS if replace(report, tried=tried).is_vacuous else Tally(report.outcome.value)
