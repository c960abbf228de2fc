"""Evidence that trials have changed, over nights: conformal e-processes, which may be looked at after every night.

If nothing has changed, trials of new seeds are exchangeable with those of the references. Then:

* The rank of a new trial among all trials so far, with ties broken at random, is uniform, and ranks of later trials are
  independent of it (Vovk, Gammerman, Shafer, *Algorithmic Learning in a Random World*, 2005, theorem 8.2). New trials
  join those that the next ones are ranked among. Ranks among the references alone would depend on each other.
* A bet on a uniform p is fair if its payoff has the mean 1. `exp(δ z - δ²/2)` with `z = Φ⁻¹(p)` has; it gains if
  trials have moved by δ standard deviations. So products of bets are martingales, and so are mixtures of products.
* A non-negative martingale that starts at 1 ever reaches c with a probability of at most 1/c (Ville 1939). Of several,
  whatever their dependence, any reaches its own level with at most the sum of 1/level.

Ranks of a night may come from a score that depends on all trials up to the end of that night, if it treats them alike:
given these trials as a set, each order of them is as likely, and the nights before depend on the order within smaller
sets. The same score may not look at which trials are new.

The packages `expectation` (its conformal part has no validation, and its products are no martingales) and `ville`
(nothing on ranks) were looked at before this was written.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SHIFTS: Final = np.array([-1.2, -0.8, -0.5, -0.3, 0.3, 0.5, 0.8, 1.2])
"""Shifts that are bet on, in standard deviations."""

LARGEST: Final = 230.0
"""Logarithm at which evidence is cut, which makes it smaller at most."""

DRAWS: Final = 99
"""Simulations of which the median is taken."""


def standardized_ranks(values: Floats) -> Floats:
    """Return mid-ranks with mean 0 and variance 1, shape [n]; zeros where all values are equal."""
    _, places, counts = np.unique(values, return_inverse=True, return_counts=True)
    ranks = (np.cumsum(counts) - counts / 2)[places] - len(values) / 2
    return np.asarray(ranks / (ranks.std() or 1.0))


def uniform(name: str, seed: int) -> float:
    """Return the number in (0, 1) by which ties of a trial are broken: the same in every run."""
    digest = hashlib.sha256(f"{name}\n{seed}".encode()).digest()
    return (int.from_bytes(digest[:6], "big") + 0.5) / 2**48


def ranks_of_new(scores: Floats, breakers: Floats) -> Floats:
    """Return p of each new trial: its rank among the trials before it and itself, as a share; ties are broken.

    Args:
        scores: in the order of trials, new ones last; shape [..., trials].
        breakers: uniform numbers for the new trials; shape [..., new].
    """
    scores = np.round(scores, 9)  # equal sums of ranks stay equal whatever the order of summing
    first = scores.shape[-1] - breakers.shape[-1]
    p = np.empty(breakers.shape)
    for at in range(breakers.shape[-1]):
        own, before = scores[..., first + at, None], scores[..., : first + at]
        below, equal = (before < own).sum(axis=-1), (before == own).sum(axis=-1) + 1
        p[..., at] = (below + breakers[..., at] * equal) / (first + at + 1)
    return p


def evidence(p: Floats, before: int, sizes: Sequence[int]) -> Floats:
    """Return the evidence after each night that trials have moved; shape [..., nights].

    A share 1 / (k (k + 1)) of the stake is bet from night k on, spread over `SHIFTS`; after night k, 1 / (k + 1) is
    still held. So a change after many quiet nights is found almost as fast as one in the first. If trials have changed
    since night k, new ones are ranked among a growing mixture of both kinds: bets shrink with the earlier ones' share.

    Args:
        p: of new trials (`ranks_of_new`), in the order of nights; shape [..., new].
        before: trials of the references.
        sizes: trials of each night; their sum is `new`.
    """
    from scipy.special import ndtri  # as in `judging.exact`

    z, ends = ndtri(p), np.cumsum(sizes)
    found = np.broadcast_to(1 / np.arange(2.0, len(ends) + 2), (*p.shape[:-1], len(ends))).copy()
    for night, begin in enumerate(ends - sizes):
        earlier = (before + begin) / (before + np.arange(begin, ends[-1]))
        moved = np.cumsum(earlier * z[..., begin:], axis=-1)[..., ends[night:] - begin - 1]
        paid = np.cumsum(earlier**2)[ends[night:] - begin - 1]
        gains = np.multiply.outer(moved, SHIFTS) - np.multiply.outer(paid, SHIFTS**2 / 2)
        found[..., night:] += np.exp(np.minimum(gains, LARGEST)).mean(axis=-1) / ((night + 1) * (night + 2))
    return found


def evidence_against_constant(before: int, nights: Sequence[tuple[int, int]]) -> list[float]:
    """Return the evidence after each night that a measure, which was the same in all trials before, no longer is.

    It is a ratio of likelihoods: "others have a uniformly distributed probability from some night on" against the
    best single probability for all trials, whatever it is (Wasserman, Ramdas, Balakrishnan, *Universal inference*,
    2020). Without another value it is below 1. The nights on which others may begin are weighted as in `evidence`.

    Args:
        before: trials before the first night; the first of them has set the value.
        nights: for each night, how many trials have another value, and how many there are.
    """
    found = []
    for last in range(1, len(nights) + 1):
        odd, all_new = (sum(night[part] for night in nights[:last]) for part in (0, 1))
        same = before - 1 + all_new - odd
        best = _log_power(odd, odd / (odd + same or 1)) + _log_power(same, same / (odd + same or 1))
        ways = [-math.log(last + 1)] if not odd else []
        for start in range(1, last + 1):
            if not any(others for others, _ in nights[: start - 1]):
                k, n = (sum(night[part] for night in nights[start - 1 : last]) for part in (0, 1))
                beta = math.lgamma(k + 1) + math.lgamma(n - k + 1) - math.lgamma(n + 2)
                ways.append(beta - math.log(start * (start + 1)))
        found.append(math.fsum(math.exp(min(way - best, LARGEST)) for way in ways))
    return found


def _log_power(times: int, share: float) -> float:
    return times * math.log(share) if times else 0.0


def nights_to_find(before: int, each: int, shift: float, level: float, most: int = 10) -> int:
    """Return the median number of nights after which normal trials that moved by `shift` SD reach `level`.

    Simulated with a fixed seed; `most` + 1 if the median is later.

    Args:
        before: trials of the references.
        each: new trials of a night.
        shift: of every trial, in standard deviations.
        level: of the evidence.
        most: nights that are simulated.
    """
    rng = np.random.default_rng(20251126)
    scores = rng.normal(size=(DRAWS, before + most * each))
    scores[:, before:] += shift
    p = ranks_of_new(scores, rng.random((DRAWS, most * each)))
    reached = evidence(p, before, [each] * most) >= level
    first = np.where(reached.any(axis=1), reached.argmax(axis=1) + 1, most + 1)
    return int(np.median(first))
