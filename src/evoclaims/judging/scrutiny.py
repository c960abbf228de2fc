"""What the judge looks for before it tests: copies of one training, whatever their seeds, and overspent budgets."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

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


TOLERATED: Final = 0.02
"""Share of a budget that may be overspent in silence."""

ALLOWED: Final = 1.0
"""Share of a budget beyond which claims are errors, unless a training loop's `overspend` says another."""


class _Spending(NamedTuple):
    """What a trial has spent of its budget, in environment steps or generations, and the most that it may spend."""

    spent: float
    budget: int
    unit: str
    allowed: float


def _spending(trial: TrialResult) -> _Spending | None:
    """Return what a trial has spent; None for one without a budget, such as an imported one, or that does not say."""
    budget, method = trial.spec.get("budget"), trial.spec.get("method")
    if not isinstance(budget, Mapping):
        return None
    steps, generations = budget.get("environment_steps"), budget.get("generations")
    name, most = ("environment_steps", steps) if steps else ("steps", generations)
    spent = [*trial.curves.get(name, ())[-1:]]
    if steps:  # of a loop whose budget is in generations, the metric may be in environment steps
        spent += [trial.metrics[name]] if name in trial.metrics else []
    if not most or not spent:
        return None
    parameters: Any = method.get("parameters") if isinstance(method, Mapping) else None
    share = parameters.get("overspend", ALLOWED) if isinstance(parameters, Mapping) else ALLOWED
    allowed = share if isinstance(share, int | float) and not isinstance(share, bool) else ALLOWED
    return _Spending(max(spent), most, "environment steps" if steps else "generations", most * (1 + allowed))


def overspent(assertion: Assertion, trials: Trials) -> tuple[str, str]:
    """Return a line on conditions whose trials overspent, and a sentence that refuses one; both empty without any."""
    lines, refusal = [], ""
    for source in assertion.sources():
        found = [(trial, spent) for trial in trials[source.fingerprint] if (spent := _spending(trial)) is not None]
        over = [(trial, spent) for trial, spent in found if spent.spent / spent.budget > 1 + TOLERATED]
        if not over:
            continue
        trial, worst = max(over, key=lambda one: one[1].spent / one[1].budget)
        in_words = f"{worst.spent:,.0f} of {worst.budget:,} {worst.unit}"  # "53,995 of 40,000 environment steps"
        lines.append(f"{len(over)} of {len(found)} trials of {source.label} spent up to {in_words}")
        if worst.spent > worst.allowed and not refusal:
            refusal = (
                f"{source.label} spent {in_words} (seed {trial.seed_in_words}), and at most {worst.allowed:,.0f} "
                "are allowed: end training within the budget, raise the budget (of a method in steps, to a multiple of "
                "its cost), or declare a larger overspend= of the training loop"
            )
    return "; ".join(lines), refusal
