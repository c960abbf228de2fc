"""The pictures of docs/findings.md, from the committed trials; run as a module, it writes them beside the page."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from statistics import fmean
from typing import Any, Final

import matplotlib
from matplotlib.figure import Figure

from evoclaims.core.drawing import saved
from evoclaims.figures import BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION
from evoclaims.figures.sheet import FAINT, plain
from evoclaims.trials.result import TrialResult
from reproductions.nisioti2025 import REPRODUCTION
from reproductions.nisioti2025.findings import METHODS, NOISE, PAGE, trials

NAMES: Final = ("NEAT", "HyperNEAT", "CMA-ES", "MAP-Elites", "PPO", "goal PPO")
PROTOCOLS: Final = {"": "text", "published": "published code", "submission": "submission", "fixed_start": "no noise"}
COLOURS: Final = {"": BLUE, "published": ORANGE, "submission": GREEN, "fixed_start": PURPLE}
EVOLVED: Final = {"neat": BLUE, "hyperneat": SKY, "cma_es": GREEN, "goal_ppo": VERMILION}


def crossed(found: Sequence[TrialResult]) -> list[float]:
    """Return the stones of each trial."""
    return [trial.metrics["stones"] for trial in found]


def by_protocol() -> Figure:
    """Draw Figure 5 under four protocols: dots are trials, lines means, diamonds the published numbers."""
    figure, axis = _axis(7.2, 2.6)
    for place, method in enumerate(METHODS):
        for beside, (variant, says) in enumerate(PROTOCOLS.items()):
            x = place + (beside - 1.5) * 0.2
            # A variant that changes nothing of a method leaves it the text's trials.
            changed = not variant or (method, "stones") in REPRODUCTION.changed_by(variant, "full")
            _dots(axis, x, crossed(trials(variant if changed else "", method)), COLOURS[variant], says)
        published = REPRODUCTION.published.value("stones", "stones", method)
        if published is not None:
            axis.plot(place, published.value, "D", color="none", markeredgecolor="black", label="the paper's plot")
    axis.set_xticks(range(len(METHODS)), NAMES)
    _finish(axis, figure)
    return figure


def by_noise() -> Figure:
    """Draw NEAT's stones against the noise on starts."""
    figure, axis = _axis(3.5, 2.4)
    for variant, share in NOISE.items():
        _dots(axis, share, crossed(trials(variant, "neat")), BLUE, "NEAT: mean and trials")
    axis.set_xlabel("share of the code's noise on starts")
    axis.set_xticks(list(NOISE.values()))
    _finish(axis, figure)
    return figure


def by_detail() -> Figure:
    """Draw mean stones under each single detail, the text's protocol as a line."""
    details = [variant for variant in _single() if any(trials(variant, method) for method in EVOLVED)]
    figure, axis = _axis(7.2, 0.17 * len(details) + 0.8)
    for method, colour in EVOLVED.items():
        axis.axvline(fmean(crossed(trials("", method))), color=colour, linewidth=0.6, linestyle=":")
        for row, variant in enumerate(details):
            if found := trials(variant, method):
                axis.plot(fmean(crossed(found)), row, "o", color=colour, label=NAMES[METHODS.index(method)])
    axis.set_yticks(range(len(details)), details)
    axis.invert_yaxis()
    axis.set_xlabel("mean stones crossed of 7; dotted: under the text's protocol")
    _legend(axis)
    figure.tight_layout()
    return figure


PICTURES: Final = {"protocols": by_protocol, "noise": by_noise, "details": by_detail}


def _single() -> Iterator[str]:
    """Yield the variants of one detail."""
    yield from (name for name in REPRODUCTION.variants if not name.startswith(("published", "submission")))


def _axis(width: float, height: float) -> tuple[Figure, Any]:
    """Return a figure (inches) with one pair of axes."""
    figure = Figure(figsize=(width, height))
    return figure, figure.add_subplot()


def _dots(axis: Any, x: float, values: Sequence[float], colour: str, label: str) -> None:
    """Draw trials as dots, and their mean as a line."""
    if not values:
        return
    spread = [x + 0.05 * (k % 3 - 1) for k in range(len(values))]
    axis.plot(spread, values, ".", color=colour, markersize=4, alpha=0.6, markeredgewidth=0)
    axis.plot([x - 0.08, x + 0.08], [fmean(values)] * 2, color=colour, linewidth=2, label=label)


def _finish(axis: Any, figure: Figure) -> None:
    """Name the axis of stones, and fit all in."""
    axis.set_ylabel("stones crossed, of 7")
    axis.set_ylim(-0.2, 7.2)
    axis.grid(axis="y", color=FAINT, linewidth=0.2)
    _legend(axis)
    figure.tight_layout()


def _legend(axis: Any) -> None:
    """List each label once."""
    handles = dict(zip(*reversed(axis.get_legend_handles_labels()), strict=True))
    axis.legend(
        handles.values(),
        handles.keys(),
        ncols=len(handles),
        frameon=False,
        fontsize=6.5,
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),  # above the panel: within it, it would hide dots
    )


def drawn(name: str) -> bytes:
    """Return a picture as SVG."""
    with plain(), matplotlib.rc_context({"lines.markersize": 4}):
        return saved(PICTURES[name](), "svg")


if __name__ == "__main__":
    for name in PICTURES:
        (PAGE.parent / f"findings-{name}.svg").write_bytes(drawn(name))
