"""The paper's own statistics, to redraw its figures; they never decide a claim."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from scipy.stats import kruskal, mannwhitneyu

ASTERISKS = ((0.0005, "***"), (0.005, "**"), (0.05, "*"))
"""The paper's thresholds: one, two and three asterisks for p below 0.05, 0.005 and 0.0005."""


@dataclass(frozen=True)
class Bracket:
    """A significance bracket between two groups of a figure: two-sided p, and its asterisks."""

    left: str
    right: str
    p: float
    asterisks: str


def asterisks(p: float) -> str:
    """Return the paper's asterisks for `p`: "", "*", "**" or "***"."""
    return next((stars for threshold, stars in ASTERISKS if p < threshold), "")


def kruskal_wallis(groups: Sequence[Sequence[float]]) -> float:
    """Return the p of the Kruskal-Wallis test that all groups share a distribution (asymptotic, as in the paper)."""
    if len({value for group in groups for value in group}) == 1:
        return 1.0  # scipy has no p for constant data
    return float(kruskal(*groups).pvalue)


def pairwise_mann_whitney(groups: Mapping[str, Sequence[float]]) -> tuple[Bracket, ...]:
    """Return the paper's two-sided Mann-Whitney U (scipy's default method) for every pair of groups."""
    brackets = []
    for (left, a), (right, b) in combinations(groups.items(), 2):
        constant = len({*a, *b}) == 1
        p = 1.0 if constant else float(mannwhitneyu(a, b, alternative="two-sided").pvalue)
        brackets.append(Bracket(left, right, p, asterisks(p)))
    return tuple(brackets)
