"""Significance brackets as in the paper: Kruskal-Wallis, then Mann-Whitney U for each pair; they decide no verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Final

from scipy.stats import kruskal, mannwhitneyu

from evoclaims.figures.sheet import INK, TEXT

ASTERISKS: Final = ((0.0005, "***"), (0.005, "**"), (0.05, "*"))
"""The paper's thresholds: one, two and three asterisks for p below 0.05, 0.005 and 0.0005."""

LEVEL: Final = ASTERISKS[-1][0]
"""Pairs are compared where the Kruskal-Wallis test of their family is below this."""
EXPLAINED: Final = (
    f"Brackets: two-sided Mann–Whitney U, where Kruskal–Wallis gives p\u00a0<\u00a0{LEVEL:g}; "
    + ", ".join(f"{stars}\u00a0p\u00a0<\u00a0{threshold:g}" for threshold, stars in reversed(ASTERISKS))
    + "."
)
"""What the brackets mean; formulae are not broken across lines."""


@dataclass(frozen=True)
class PairTest:
    """Two samples of a family of samples, compared.

    Attributes:
        left, right: their indices.
        family: the indices of all samples of the family that are not empty.
        p: of the two-sided Mann-Whitney U test.
        overall: p of the family's Kruskal-Wallis test.
        asterisks: for the figure; empty unless both tests are significant.
    """

    left: int
    right: int
    family: tuple[int, ...]
    p: float
    overall: float
    asterisks: str


def compare(samples: Sequence[Sequence[float]], families: Sequence[Sequence[int]]) -> tuple[PairTest, ...]:
    """Compare every pair of each family.

    Args:
        samples: numbers; a sample without trials is empty and not compared.
        families: indices of the samples that are compared with each other.
    """
    found = []
    for family in families:
        present = tuple(i for i in family if samples[i])
        if len(present) < 2:
            continue
        groups = [samples[i] for i in present]
        constant = len({value for group in groups for value in group}) == 1  # scipy has no p for constant data
        overall = 1.0 if constant else float(kruskal(*groups).pvalue)  # asymptotic, as in the paper
        for left, right in combinations(present, 2):
            a, b = samples[left], samples[right]
            # By scipy's default method, as in the paper.
            p = 1.0 if len({*a, *b}) == 1 else float(mannwhitneyu(a, b, alternative="two-sided").pvalue)
            stars = next((stars for threshold, stars in ASTERISKS if p < threshold and overall < LEVEL), "")
            found.append(PairTest(left, right, present, p, overall, stars))
    return tuple(found)


def stack(spans: Sequence[tuple[float, float]], tops: Sequence[tuple[float, float]], row: float) -> list[float]:
    """Return the height of a bracket over each span, the lowest for short spans, so that none overlap.

    Args:
        spans: left and right end of each bracket.
        tops: place and height of what is below, such as bars.
        row: height of a bracket with its asterisks.
    """
    heights = [0.0] * len(spans)
    placed: list[int] = []
    for i in sorted(range(len(spans)), key=lambda i: (spans[i][1] - spans[i][0], spans[i])):
        left, right = spans[i]
        below = [height for place, height in tops if left <= place <= right]
        below += [heights[j] + row for j in placed if spans[j][0] <= right and left <= spans[j][1]]
        heights[i] = max(below) + 0.35 * row
        placed.append(i)
    return heights


def paint(axis: Any, span: tuple[float, float], height: float, row: float, asterisks: str) -> None:
    """Paint one bracket."""
    left, right = span
    foot = height - 0.2 * row
    axis.plot([left, left, right, right], [foot, height, height, foot], color=INK, linewidth=0.6, clip_on=False)
    # Asterisks sit high in a line of text: the line starts below what is visible.
    axis.annotate(
        asterisks,
        ((left + right) / 2, height),
        xytext=(0, -2.2),
        textcoords="offset points",
        ha="center",
        va="bottom",
        fontsize=TEXT,
    )
