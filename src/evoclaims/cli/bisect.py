"""`evoclaims bisect`: the release in which a claim's verdict, its trials' distribution, or their bits changed."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Final

from evoclaims.cli.elsewhere import between, opened, released
from evoclaims.core.environments import Recipe, checked, checked_name
from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.judging.verdict import Outcome
from evoclaims.report.formatting import plural
from evoclaims.verdicts.across import Cell, Judged, across


@dataclass(frozen=True)
class Change:
    """Where it changed.

    Attributes:
        before: index of the last member that is still as the first.
        after: index of the first member that is as the last.
        unknown: the members between these, about which nothing is known.
    """

    before: int
    after: int
    unknown: tuple[int, ...] = ()


def bisect(length: int, has_changed: Callable[[int], bool | None]) -> Change:
    """Return where a row of members changes, if it changes once.

    Args:
        length: of the row, at least two; the first member has not changed, and the last one has.
        has_changed: whether the member at an index has; None if that is unknown, so that another one near it is
            asked about. It is called at most once for each.
    """
    before, after = 0, length - 1
    unknown: set[int] = set()
    while left := [index for index in range(before + 1, after) if index not in unknown]:
        asked = min(left, key=lambda index: abs(2 * index - before - after))
        answer = has_changed(asked)
        if answer is None:
            unknown.add(asked)
        elif answer:
            after = asked
        else:
            before = asked
    return Change(before, after, tuple(sorted(index for index in unknown if before < index < after)))


KINDS: Final[Mapping[str, Callable[[Cell], bool]]] = {
    "verdict": lambda cell: cell.verdict_changed,
    "drift": lambda cell: cell.drifted,
    "bits": lambda cell: cell.changed > 0,
}
"""What can have changed against the first release, the weightiest first."""

UNCOMPARED: Final[Mapping[str, Callable[[Cell], Collection[tuple[str, str]]]]] = {
    "verdict": lambda cell: (),
    "drift": lambda cell: cell.untested,
    "bits": lambda cell: cell.without_bits,
}
"""What of a claim could not be compared with the first release, so that it may have changed unseen."""


def main(options: argparse.Namespace) -> int:
    """Find the release and print it; 1 when nothing changed between the two that are named."""
    if options.by not in (None, *KINDS):
        raise UnknownNameError("kind of change", options.by, KINDS)
    package, good, bad = checked_name(options.package), checked(options.good), checked(options.bad)
    releases = between(good, bad, [checked(one) for one in options.releases or released(package)])
    elsewhere, tried = opened(options, options.claim), dict[int, Judged]()

    def judge(index: int) -> Judged:
        tried[index] = elsewhere.judge(Recipe(package, releases[index]))
        return tried[index]

    last = len(releases) - 1
    for index, option in ((0, "--good"), (last, "--bad")):
        if judge(index).trouble:
            raise UserError(
                f"{tried[index].label}, named by {option}, cannot be judged: {tried[index].trouble}. If "
                "the release itself is the cause, name another one."
            )
        if late := [name for name, report in tried[index].reports.items() if report.wants_time]:
            raise UserError(
                f"{tried[index].label}, named by {option}, does not decide {', '.join(late)}, since trials ran out of "
                "time. Give them more: time_limit in pyproject.toml."
            )
    at_the_end = _cells(tried[0], tried[last])
    kinds = [kind for kind in KINDS if options.by in (None, kind) and any(map(KINDS[kind], at_the_end))]
    if not kinds:
        found = _unchanged(tried[0], tried[last], [kind for kind in KINDS if options.by in (None, kind)])
        print(f"{options.claim} with {package} {bad} as with {good}: {found}.")
        return 1
    kind = kinds[0]
    print(
        f"The {kind} of {options.claim} changed from {package} {good} to {bad}, with {last - 1} releases between them.",
        flush=True,
    )
    claims = tried[0].reports.keys() | tried[last].reports.keys()
    broken_at_the_ends = _broken(tried[0], claims) | _broken(tried[last], claims)
    never_compared = _uncompared(at_the_end, kind)
    why = dict[int, str]()

    def has_changed(index: int) -> bool | None:
        now = judge(index)
        if now.trouble or _broken(now, claims) - broken_at_the_ends:
            why[index] = now.trouble or "the claim is broken or not run there, or wants more time"
            return None
        cells = _cells(tried[0], now)
        if any(map(KINDS[kind], cells)):
            return True
        if _uncompared(cells, kind) - never_compared:
            why[index] = f"not all of its trials can be compared with those of {tried[0].label} for {kind}"
            return None
        return False

    unseen = _in_part(kind, never_compared)
    _tell(bisect(len(releases), has_changed), releases, tried, package, kind, options.claim, why, unseen)
    return 0


def _cells(first: Judged, now: Judged) -> list[Cell]:
    return [cell for (_, label), cell in across([first, now]).cells.items() if label == now.label]


def _uncompared(cells: Collection[Cell], kind: str) -> set[tuple[str, str]]:
    """Return what may have changed unseen, such as the bits of trials of another machine."""
    return {one for cell in cells for one in UNCOMPARED[kind](cell)}


def _in_part(kind: str, uncompared: Collection[tuple[str, str]]) -> str:
    """Return in parentheses where something may have changed unseen; empty if all was compared."""
    labels = sorted({label for label, _ in uncompared})
    return f" (the {kind} of {', '.join(labels)} can be compared in part or not at all)" if labels else ""


def _unchanged(first: Judged, last: Judged, kinds: Collection[str]) -> str:
    """Return in words what of these kinds is the same at both ends, as far as it could be compared."""
    cells = _cells(first, last)
    compared = sum(cell.compared for cell in cells)
    tested = compared or any(cell.drift is not None for cell in cells)  # the same bits need no test
    found = {
        "verdict": "the same verdict",
        "drift": "no drift shown" if tested else "no trials tested for drift",
        "bits": f"{plural(compared, 'trial')} the same to the bit" if compared else "no trial compared to the bit",
    }
    if compared:
        found["bits"] += _in_part("bits", _uncompared(cells, "bits"))
    if tested:
        found["drift"] += _in_part("drift", _uncompared(cells, "drift"))
    if all(cell.same for cell in cells):
        found |= dict.fromkeys(("drift", "bits"), "the same trials, since none depends on it")
    return ", ".join(dict.fromkeys(found[kind] for kind in kinds))


def _broken(judged: Judged, claims: Collection[str]) -> set[tuple[str, Outcome]]:
    """Return the claims that broke, did not run, are missing or want time: no sign of a change, unless at an end."""
    late = {name for name, report in judged.reports.items() if report.wants_time}
    return {(name, outcome) for name in claims if not (outcome := judged.outcome(name)).judged or name in late}


def _tell(
    change: Change,
    releases: list[str],
    tried: Mapping[int, Judged],
    package: str,
    kind: str,
    claim: str,
    why: Mapping[int, str],
    unseen: str,
) -> None:
    """Print where it changed, what is known about it, why it is not for the others, and how many environments ran."""
    before, after, what = releases[change.before], releases[change.after], f"The {kind} of {claim}"
    for line in across([tried[change.before], tried[change.after]]).lines:
        print(f"  {line}")
    if change.unknown:
        print(f"{what} changed after {package} {before} and not later than {after}{unseen}; unknown between them:")
        for index in change.unknown:
            print(f"  {tried[index].label}: {why[index]}")
    else:
        still = "shows no drift from" if kind == "drift" else "was still as"
        print(f"{what} changed in {package} {after}; {before} {still} {releases[0]}{unseen}.")
    print(f"environments: {len(tried)}, for {len(releases)} releases")
