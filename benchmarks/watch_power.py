"""What `evoclaims watch` finds, and how often it is wrong: nights drawn from the committed smoke trials.

Nights draw seeds with replacement from the reference trials and pilots, whole trials of all conditions together. Under
a shift, trials of a method's conditions are drawn with weights exp(shift · z), where z is the normal score of the
mean rank of the measures: a normal one would move by so many standard deviations, and no value is a new one.

    python benchmarks/watch_power.py [RUNS] [NIGHTS]

docs/releases.md has the results.
"""

from __future__ import annotations

import dataclasses
import statistics
import sys
from collections.abc import Sequence

import numpy as np
from scipy.stats import norm, rankdata

from evoclaims.cli.project import open_project
from evoclaims.cli.watch import watch_of
from evoclaims.judging.drift import LOWER
from evoclaims.judging.e_process import standardized_ranks, uniform
from evoclaims.verdicts.watch import ALPHA, Family, Watch, Watched
from evoclaims.verdicts.watch_file import Night

EACH = 30


def main() -> None:
    """Print the share of null runs with an alarm, then nights to an alarm for shifts of each method."""
    runs, nights = (int(text) for text in (*sys.argv[1:], "100", "5")[:2])
    watch = watch_of(open_project(".evoclaims"), "smoke")[0]
    print(f"{len(watch.conditions)} conditions, {len(watch.families)} families, alarm at {watch.level:g}")
    alarms = sum(first_alarm(watch, watch.families, run, nights) <= nights for run in range(runs))
    print(f"nothing changed: {alarms} of {runs} runs of {nights} nights have an alarm (α {ALPHA:g})")
    methods = [one for one in watch.families if one.of_method and one.moves]
    for shift in (0.5, 0.8):
        for family in sorted(methods, key=lambda one: -len(one.conditions)):
            found = [first_alarm(watch, [family], run, 6, shift) for run in range(runs // 2)]
            print(
                f"{shift:g} SD in {family.label}, {_varying(family)} conditions that vary: night "
                f"{statistics.median(found):g} in the median (7: later), {found.count(1)} of {len(found)} on the first",
                flush=True,
            )


def _varying(family: Family) -> int:
    """Return how many conditions have a measure in the sum that varies."""
    return sum(not all(map(one.constant, one.whole)) for one in family.conditions)


def first_alarm(watch: Watch, families: Sequence[Family], run: int, nights: int, shift: float = 0.0) -> int:
    """Return the first night on which one of some families, whose conditions are shifted, has an alarm."""
    sources = dict.fromkeys(one.label for family in families for one in family.conditions)
    found: list[Night] = []
    drawn = {one.label: redrawn(one, one.seeds, run, 0.0) for one in watch.conditions if one.label in sources}
    those = [
        dataclasses.replace(family, conditions=tuple(drawn[one.label] for one in family.conditions))
        for family in families
    ]
    for night in range(nights):
        seeds = range(10_000 + EACH * night, 10_000 + EACH * (night + 1))
        values = {
            one.label: dict(redrawn(one, seeds, run, shift).values) for one in watch.conditions if one.label in sources
        }
        found.append(Night("", "smoke", 1, "", tuple(seeds), "", watch.level, {}, values, {}))
    paths = [family.path(found) for family in those if family.of_method or family.moves]
    reached = [at for at, row in enumerate(zip(*paths, strict=True), start=1) if max(row) >= watch.level]
    return min(reached, default=nights + 1)


def redrawn(one: Watched, seeds: Sequence[int], run: int, shift: float) -> Watched:
    """Return a condition with other trials, drawn from the committed ones by seeds; each is drawn as a whole."""
    varying = [name for name in one.whole if not one.constant(name)]
    weights = np.ones(len(one.seeds))
    if shift and varying:
        mean = sum(standardized_ranks(np.array(one.values[name])) * (-1 if name in LOWER else 1) for name in varying)
        weights = np.exp(shift * norm.ppf(rankdata(mean) / (len(one.seeds) + 1)))
    steps = np.cumsum(weights / weights.sum())
    name = one.label if shift else "all"  # without a shift, trials of one seed belong together
    at = [int(np.searchsorted(steps, uniform(f"{run} {name}", seed))) for seed in seeds]
    values = {  # what pilots lack is drawn from the references again, and is as short in the committed trials
        name: tuple(values[place % len(values)] for place in (at[: len(values)] if seeds is one.seeds else at))
        for name, values in one.values.items()
    }
    return dataclasses.replace(one, values=values)


if __name__ == "__main__":
    main()
