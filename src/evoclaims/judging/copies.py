"""Copies: trials of one condition whose training was the same, whatever their seeds."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from evoclaims.judging.assertion import Assertion
from evoclaims.judging.sample import Trials
from evoclaims.trials.result import COMPLETE, RETURNED, TRAINED_BY, TrialResult

SHORT: Final = 4
"""Numbers that so many decimals write may be equal by chance, as shares of few episodes are."""

MOST_BY_CHANCE: Final = 3
"""So many other numbers, all different, that two imported trials share all are no chance."""


@dataclass(frozen=True)
class Copies:
    """The copies among fetched trials.

    Attributes:
        trials: the trials that count: of each source, those at the positions where no source has a copy. Positions are
            left out for all sources together, so that these keep equally many trials.
        kept: how many trials per source count.
        sentence: names the copies; empty if there are none.
        alone: the label of a source whose trials are all copies of one; empty without one.
    """

    trials: Trials
    kept: int
    sentence: str = ""
    alone: str = ""


def copies(assertion: Assertion, trials: Trials) -> Copies:
    """Find the copies among the trials that an assertion takes for independent draws.

    A method that declares that it draws nothing (`deterministic`) may have copies.
    """
    left_out, sentences, alone = set[int](), list[str](), ""
    count = max(map(len, trials.values()), default=0)
    for source in assertion.drawn():
        if source.deterministic:
            continue
        mine = trials[source.fingerprint]
        groups = _groups(mine)
        left_out |= {position for group in groups for position in group[1:]}
        named = "; ".join(f"seeds {', '.join(mine[position].seed_in_words for position in group)}" for group in groups)
        if groups:
            sentences.append(f"{source.label} has copies of the same training ({named})")
        if groups and len(groups[0]) == len(mine):
            alone = source.label
    kept = [position for position in range(count) if position not in left_out]
    counted = {mark: tuple(those[position] for position in kept) for mark, those in trials.items()}
    return Copies(counted if left_out else trials, len(kept), "; ".join(sentences), alone)


def _groups(trials: Sequence[TrialResult]) -> list[list[int]]:
    """Return the positions of trials that are copies of each other, at least two each."""
    champions = Counter(trial.champion for trial in trials)
    found: dict[Hashable, list[int]] = {}
    for position, trial in enumerate(trials):
        if trial.champion and champions[trial.champion] == 1:  # its curves need not be compared, which takes longer
            continue
        if (mark := _training(trial)) is not None:
            found.setdefault(mark, []).append(position)
    return [group for group in found.values() if len(group) > 1]


def _training(trial: TrialResult) -> Hashable | None:
    """Return what training gave, equal for copies alone; None where the record does not say.

    Examinations are left out: their starts differ from seed to seed, so copies of one policy score differently. Of an
    engine's trial, champion and training curves count: what may be equal by chance (a success, a network of few bits)
    is not enough. Of a training loop, which keeps no champion, reported curves, the actions of its policy on fixed
    starts, and what it returned; the last may differ between copies (wall times do), so it counts only where curves
    and actions are whole numbers, which two trainings may share. Of an imported trial, all that its table has counts
    where some of it is hardly shared by chance.
    """
    if trial.champion:
        return trial.champion, trial.curves_hash
    if "imported" in trial.spec:
        read = [*trial.metrics.values(), *itertools.chain.from_iterable(trial.curves.values())]
        long = {number for number in read if math.isfinite(number) and number != round(number, SHORT)}
        return (repr(sorted(trial.metrics.items())), trial.curves_hash) if len(long) >= MOST_BY_CHANCE else None
    if TRAINED_BY not in trial.provenance or trial.status not in COMPLETE or not trial.digest:  # a pilot has no digest
        return None
    returned = trial.provenance[RETURNED]
    telling = returned["graded"] or _is_telling(itertools.chain.from_iterable(trial.curves.values()))
    return trial.curves_hash, returned["actions"], None if telling else returned["metrics"]


def _is_telling(numbers: Iterable[float]) -> bool:
    """Whether some number is not whole, so that two trials hardly share all of them by chance."""
    return any(math.isfinite(number) and not float(number).is_integer() for number in numbers)
