"""The nights of `evoclaims watch` in the report: evidence over nights, by family."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evoclaims.report.formatting import plural
from evoclaims.report.training_curves import CurvePanel, Line
from evoclaims.verdicts.watch_file import Night, standing


@dataclass(frozen=True, eq=False)
class WatchShown:
    """The last series of nights at a tier.

    Attributes:
        tier: whose conditions ran.
        says: how many nights, and the largest evidence, in a sentence.
        panel: the logarithm to base 10 of each family's evidence, and of the level of an alarm.
    """

    tier: str
    says: str
    panel: CurvePanel


def shown(nights: Sequence[Night]) -> tuple[WatchShown, ...]:
    """Return the last series of each tier."""
    return tuple(
        _last_series([night for night in nights if night.tier == tier]) for tier in sorted({one.tier for one in nights})
    )


def _last_series(every: Sequence[Night]) -> WatchShown:
    """Return the last series of a tier, which has at least one night."""
    last = every[-1]
    nights = [night for night in every if night.series == last.series]
    x = np.arange(len(nights) + 1.0)
    paths = {name: [1.0, *(night.evidence[name] for night in nights)] for name in last.evidence}
    lines = [Line(name, x, np.log10(path)) for name, path in paths.items()]
    alarm = Line(f"alarm at {last.level:g}", x, np.full(len(x), np.log10(last.level)))
    name = max(last.evidence, key=last.evidence.__getitem__)
    alarms = sorted(name for name, path in paths.items() if max(path) >= last.level)
    says = (
        f"{plural(len(nights), 'night')} up to {last.date}, alarm at an evidence of {last.level:g}. Largest on the "
        f"last night: {name} with {last.evidence[name]:.2g}. Alarms: {', '.join(alarms) or 'none'}."
    )
    says = " ".join([says, *standing(every)])
    return WatchShown(last.tier, says, CurvePanel(f"log10 of evidence ({last.tier})", (*lines, alarm), None, 0))
