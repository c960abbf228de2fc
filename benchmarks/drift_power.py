"""How often one run of smoke finds that a method has drifted, and how often it is wrong, by trials drawn again.

Ten new trials a condition are drawn with replacement from the reference trials and both pilots. Under a shift, trials
of one method's conditions are drawn with weights exp(shift · z), where z is the normal score of the mean rank of the
measures: a normal one would move by so many standard deviations. A measure that pilots lack is that of a reference
trial.

    python benchmarks/drift_power.py [SHIFT] [RUNS]

docs/judging.md has the results.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, rankdata

from evoclaims.claims.power import Pilots, with_test
from evoclaims.cli.project import open_project
from evoclaims.judging.drift import LOWER, DriftCase, check_drift, measured
from evoclaims.judging.e_process import standardized_ranks
from evoclaims.paper import references
from evoclaims.trials.result import TrialResult

NEW = 10


@dataclass(frozen=True)
class Drawn:
    """What trials of a condition are drawn from.

    Attributes:
        method: its name.
        reference: trials that have every measure.
        every: these and the pilots'.
        case: without new trials.
        score: the normal score of each trial, better when higher; None if no measure varies.
    """

    method: str
    reference: list[TrialResult]
    every: list[TrialResult]
    case: DriftCase
    score: NDArray[np.float64] | None

    def again(self, shift: float, draw: np.random.Generator) -> DriftCase:
        """Return the case with new trials."""
        weights = np.ones(len(self.every)) if self.score is None else np.exp(shift * self.score)
        new = []
        for number, at in enumerate(draw.choice(len(self.every), NEW, p=weights / weights.sum())):
            one, other = self.every[at], self.reference[draw.integers(len(self.reference))]
            whole = one if at < len(self.reference) else other  # a pilot has only what claims read
            parts = {part: {**getattr(whole, part), **getattr(one, part)} for part in ("metrics", "levels", "curves")}
            new.append(replace(whole, seed=20_000 + number, status=one.status, digest="", **parts))
        return replace(self.case, new=tuple(new))


def main() -> None:
    """Print in how many runs a method is found, without a shift and with one."""
    shift, runs = (kind(text) for kind, text in zip((float, int), (*sys.argv[1:], "0.8", "20")[:2], strict=True))
    conditions = drawn_from()
    varying = [one.method for one in conditions if one.score is not None]
    draw = np.random.default_rng(20251127)
    several = {method for method in varying if varying.count(method) > 1}
    for method in ("", *sorted(several, key=lambda name: (-varying.count(name), name))):
        reports = [
            check_drift([one.again(shift * (one.method == method), draw) for one in conditions]) for _ in range(runs)
        ]
        named = f"{method} on " if method else ""
        found = sum(any(row.drifted and row.label.startswith(named) for row in report.rows) for report in reports)
        what = f"{shift:g} SD in {method}, {varying.count(method)} conditions that vary" if method else "no shift"
        print(f"{what}: found in {found} of {runs} runs", flush=True)


def drawn_from() -> list[Drawn]:
    """Return the conditions of smoke's claims with their committed trials."""
    project = open_project(".evoclaims")
    (collected,) = project.collect([("", "smoke")])
    both = [Pilots(project.reproduction, "smoke", with_test(collected), second=second) for second in (False, True)]
    found = []
    for names, group in sorted(both[0].groups.items()):
        mine = references.of_condition(project.reproduction.references, "smoke", *names, group.condition.id)
        pilot = [trial for those in both if not those.unfit(names) for trial in those.trials[names]]
        reads = both[0].reads(names, mine[0])
        case = references.paired(" on ".join(names), mine, mine, method=names[0], reads=reads, pilot=pilot)
        found.append(Drawn(names[0], [*mine], [*mine, *pilot], case, _score([*mine, *pilot], case.metrics)))
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
