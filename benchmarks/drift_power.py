"""How often one run of smoke finds that a method has drifted, and how often it is wrong, by trials drawn again.

New trials of each condition, as many as a run makes, and the earlier ones are drawn with replacement from the
reference trials and both pilots. Under a shift, new trials of one method's conditions are drawn with weights
exp(shift · z), where z is the normal score of the mean rank of the measures: a normal one would move by so many
standard deviations. A measure that pilots lack is that of a reference trial. A method that moves is compared at the
strictest of Holm's levels. A drift that was found is repeated as a run does, with fresh trials that have moved alike.

    python benchmarks/drift_power.py [SHIFT] [RUNS]

docs/judging.md has the results.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, rankdata

from evoclaims.claims.earlier_trials import ALPHA_REPEATED, TIMES
from evoclaims.claims.power import Pilots, with_test
from evoclaims.cli.project import open_project
from evoclaims.judging.drift import ALPHA, LOWER, DriftCase, check_drift, measured
from evoclaims.judging.e_process import standardized_ranks
from evoclaims.paper import references
from evoclaims.trials.result import TrialResult

PARTS = ("metrics", "levels", "curves")


@dataclass(frozen=True)
class Drawn:
    """What trials of a condition are drawn from.

    Attributes:
        method: its name.
        new: how many trials a run makes.
        reference: trials that have every measure.
        every: these and the pilots'.
        case: of the committed trials.
        score: the normal score of each trial, better when higher; None if no measure varies.
    """

    method: str
    new: int
    reference: list[TrialResult]
    every: list[TrialResult]
    case: DriftCase
    score: NDArray[np.float64] | None

    def again(self, shift: float, draw: np.random.Generator) -> DriftCase:
        """Return the case with other trials on both sides."""
        case, weights = self.case, np.ones(len(self.every))
        return replace(
            case,
            new=self.fresh(self.new, shift, draw),
            reference=self._drawn(len(self.reference), weights, draw),
            pilot=tuple(_like(case.pilot[0], one) for one in self._drawn(len(case.pilot), weights, draw)),
        )

    def fresh(self, n: int, shift: float, draw: np.random.Generator) -> tuple[TrialResult, ...]:
        """Return new trials, which have moved."""
        moved = np.ones(len(self.every)) if self.score is None else np.exp(shift * self.score)
        return tuple(replace(one, seed=20_000 + one.seed) for one in self._drawn(n, moved, draw))

    def _drawn(self, n: int, weights: NDArray[np.float64], draw: np.random.Generator) -> tuple[TrialResult, ...]:
        """Return trials with every measure."""
        found = []
        for number, at in enumerate(draw.choice(len(self.every), n, p=weights / weights.sum())):
            one, other = self.every[at], self.reference[draw.integers(len(self.reference))]
            whole = one if at < len(self.reference) else other  # a pilot has only what claims read
            parts = {part: {**getattr(whole, part), **getattr(one, part)} for part in PARTS}
            found.append(replace(whole, seed=number, status=one.status, digest="", **parts))
        return tuple(found)


def _like(pilot: TrialResult, trial: TrialResult) -> TrialResult:
    """Return a trial with those measures that a pilot has."""
    parts = {part: {name: getattr(trial, part)[name] for name in getattr(pilot, part)} for part in PARTS}
    return replace(trial, **parts)


def main() -> None:
    """Print in how many runs a method is found, without a shift and with one."""
    given = [*sys.argv[1:], *("0.8", "20")[len(sys.argv) - 1 :]]
    shift, runs = float(given[0]), int(given[1])
    conditions = drawn_from()
    varying = [one.method for one in conditions if one.score is not None]

    def found(those: Sequence[Drawn], shift: float, alpha: float) -> str:
        draw = np.random.default_rng([20251127, *those[0].method.encode(), len(those)])  # whatever else is drawn
        once = twice = 0
        for _ in range(runs):
            cases = [one.again(shift, draw) for one in those]
            drifted = {row.label for row in check_drift(cases, alpha).rows if row.drifted}
            once += bool(drifted)
            for method in sorted({one.method for one in those if one.case.label in drifted}):
                several = [(one, case) for one, case in zip(those, cases, strict=True) if one.method == method]
                again = [replace(case, new=one.fresh(TIMES * one.new, shift, draw)) for one, case in several]
                if check_drift(again, ALPHA_REPEATED).drifted:
                    twice += 1
                    break
        return f"found in {once} of {runs} runs, and again by fresh trials in {twice}"

    methods = len(check_drift([one.again(0.0, np.random.default_rng(0)) for one in conditions]).detectable)
    print(f"no shift in {methods} methods: {found(conditions, 0.0, ALPHA)}", flush=True)
    several = {method for method in varying if varying.count(method) > 1}
    for method in sorted(several, key=lambda name: (-varying.count(name), name)):
        mine = [one for one in conditions if one.method == method]
        what = f"{shift:g} SD in {method}, {varying.count(method)} conditions that vary"
        print(f"{what}: {found(mine, shift, ALPHA / methods)}", flush=True)


def drawn_from() -> list[Drawn]:
    """Return the conditions of smoke's claims with their committed trials."""
    project = open_project(".evoclaims")
    (collected,) = project.collect([("", "smoke")])
    both = [Pilots(project.reproduction, "smoke", with_test(collected), second=second) for second in (False, True)]
    tier, found = project.reproduction.tier("smoke"), []
    for names, group in sorted(both[0].groups.items()):
        mine = references.of_condition(project.reproduction.references, "smoke", *names, group.condition.id)
        pilot = [trial for those in both if not those.unfit(names) for trial in those.trials[names]]
        reads = both[0].reads(names, mine[0])
        case = references.paired(" on ".join(names), mine, mine, method=names[0], reads=reads, pilot=pilot)
        new, every = tier.design.last.n + len(tier.seeds_for_drift(*names)), [*mine, *case.pilot]
        found.append(Drawn(names[0], new, [*mine], every, case, _score(every, case.metrics)))
    return found


def _score(trials: list[TrialResult], measures: tuple[str, ...]) -> NDArray[np.float64] | None:
    ranks = []
    for name in measures:
        try:
            values = np.array([measured(trial, name) for trial in trials])
        except KeyError:  # pilots lack it
            continue
        if np.ptp(values) > 1e-6 * np.abs(values).max():
            ranks.append(standardized_ranks(values) * (-1 if name in LOWER else 1))
    return norm.ppf(rankdata(sum(ranks)) / (len(trials) + 1)) if ranks else None


if __name__ == "__main__":
    main()
