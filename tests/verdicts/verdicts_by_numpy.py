"""Verdicts computed again from the committed records, by NumPy and nothing of evoclaims: an independent check.

An assertion comes as its plain description, the one that fingerprints hash. Values are read from the lines of the JSON
files by the names of measures, p values are counted or enumerated anew.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

MARGIN, P0 = 0.71, 0.7
Ps = tuple[float, float, float | None]
"""p for, against, and against the claimed size, if there is one."""

METRICS = {
    "stones crossed": "stones",
    "share of the maze on the path": "coverage",
    "share of steps upside-down": "upside_down",
    "control cost": "control_cost",
    "mean success over levels": "mean_success",
    "success on the last level": "last_success",
    "episode reward": "last_fitness",
    "furthest level reached": "furthest_reached",
    "obstacles passed": "obstacles",
    "share of episodes that reach the target": "reached",
}
"""Measures that are a metric of the record."""

OTHERS: dict[str, Callable[[Any], float]] = {
    "share of the maze with an elite": lambda t: t["curves"]["coverage"][-1],
    "success beyond guessing on the last level": lambda t: (
        (t["metrics"]["last_success"] - t["guess"]) / (1 - t["guess"])
    ),
    "seldom reaches the target": lambda t: t["metrics"]["reached"] <= 0.5,
    "whether the target was found": lambda t: t["curves"]["reached"][-1],
    "m a step": lambda t: t["metrics"]["furthest"] / t["metrics"]["episode_steps"],
    "reward before costs": lambda t: t["metrics"]["last_fitness"] + t["metrics"]["control_cost"],
    "reward of training's best episode": lambda t: t["curves"]["fitness"][-1],
    "neurons and connections of the champion": lambda t: (
        t["curves"]["champion_nodes"][-1] + t["curves"]["champion_connections"][-1]
    ),
    "connections of the champion": lambda t: t["curves"]["champion_connections"][-1],
    "reward gained": lambda t: t["curves"]["fitness"][-1] - t["curves"]["fitness"][0],
    "reaches the target": lambda t: t["metrics"]["reached"] > 0.5,
    "never reaches the target": lambda t: t["metrics"]["reached"] == 0,
    "has found the target": lambda t: t["curves"]["reached"][-1] == 1,
    "solves every level": lambda t: set(t["levels"]["success"]) == {1.0},
    "does not solve the last level": lambda t: t["metrics"]["furthest_solved"] < len(t["levels"]["success"]) - 1,
    "most neurons of the champion are hidden": lambda t: t["curves"]["champion_nodes"][-1] > 2 * t["ends"],
    "at most half of the champion's neurons are hidden": lambda t: t["curves"]["champion_nodes"][-1] <= 2 * t["ends"],
}

PATTERNS: dict[str, Callable[[Any, float], float]] = {
    r"success at level (\d+)": lambda t, x: t["levels"]["success"][int(x)],
    r"crosses ([\d.]+) stones": lambda t, x: t["metrics"]["stones"] == x,
    r"crosses at most ([\d.]+) stones": lambda t, x: t["metrics"]["stones"] <= x,
    r"passes at most ([\d.]+) obstacles": lambda t, x: t["metrics"]["obstacles"] <= x,
    r"upside-down in more than ([\d.]+) of the steps": lambda t, x: t["metrics"]["upside_down"] > x,
    r"control cost above ([\d.]+) of the reward": lambda t, x: (
        t["metrics"]["control_cost"] > x * (t["metrics"]["last_fitness"] + t["metrics"]["control_cost"])
    ),
    r"ends within ([\d.]+) m of the target": lambda t, x: t["metrics"]["distance"] <= x,
    r"solves level (\d+)": lambda t, x: t["metrics"]["furthest_solved"] >= x,
    r"solves no level beyond (\d+)": lambda t, x: t["metrics"]["furthest_solved"] <= x,
    r"success on the last level is ([\d.]+)": lambda t, x: t["metrics"]["last_success"] == x,
    r"success is ([\d.]+) on every level": lambda t, x: set(t["levels"]["success"]) == {x},
}


CURVES: dict[str, Callable[..., float]] = {
    r"(\w+) on average": lambda c, name: c[name].mean(),
    r"(\w+) at the end": lambda c, name: c[name][-1],
    r"(\w+) is always ([\d.]+)": lambda c, name, x: (c[name] == float(x)).all(),
    r"reports with (\w+) of ([\d.]+)": lambda c, name, x: (c[name] >= float(x)).sum(),
    r"share of (\w+) against (\w+)": lambda c, part, other: c[part].sum() / (c[part].sum() + c[other].sum()),
    r"fall of (\w+) in a generation": lambda c, name: (c[name][0] - c[name][-1]) / np.ptp(c["steps"]),
}
"""Of mechanisms."""


@dataclass(frozen=True)
class Records:
    """Committed trials by condition and seed.

    Attributes:
        trials: the lines of the files.
        ends: inputs and outputs of the networks of a condition, which no record has.
        guesses: success at the last level of the best constant answer, by condition; for circuits.
    """

    trials: Mapping[str, Mapping[int, Any]]
    ends: Mapping[str, int]
    guesses: Mapping[str, float]

    def of(self, reading: Mapping[str, Any], n: int) -> list[float]:
        """Read a measure or an event from the first `n` trials; a KeyError says that one is missing."""
        assert not reading.keys() & {"limit", "every"}, "censored measures are not among the committed claims"
        found = [self.trials[reading["condition"]][seed] for seed in range(n)]
        worst = -math.inf if reading.get("better", "higher") == "higher" else math.inf
        if "better" not in reading:
            worst = 0.0
        known = {"ends": self.ends[reading["condition"]], "guess": self.guesses.get(reading["condition"])}
        return [float(read(reading["name"], {**t, **known})) if t["status"] == "done" else worst for t in found]


def load(folder: Path) -> dict[str, dict[int, Any]]:
    """Read the reference trials of a tier."""
    found: dict[str, dict[int, Any]] = {}
    for path in sorted(folder.glob("*.jsonl")):
        for line in path.read_text(encoding="utf-8").splitlines():
            trial = json.loads(line)
            assert trial["status"] in ("done", "diverged")
            found.setdefault(trial["condition"], {})[trial["seed"]] = trial
    return found


def read(name: str, trial: Any) -> float:
    """Return what a trial has under the name of a measure or event."""
    if name in METRICS:
        return float(trial["metrics"][METRICS[name]])
    if name in OTHERS:
        return OTHERS[name](trial)
    for pattern, of in PATTERNS.items():
        if match := re.fullmatch(pattern, name):
            return of(trial, float(match[1]))
    for pattern, of_curves in CURVES.items():
        if match := re.fullmatch(pattern, name):
            return float(
                of_curves({curve: np.array(values) for curve, values in trial["curves"].items()}, *match.groups())
            )
    raise LookupError(f"no reading of {name!r}: add one here")


def rank_p(a: Sequence[float], b: Sequence[float]) -> float:
    """P(sum of A's mid-ranks as large) over all splits: subsets counted by size and by doubled rank sum."""
    pooled = np.array([*a, *b])
    doubled = np.array([(pooled < x).sum() + (pooled <= x).sum() + 1 for x in pooled])
    ways = np.zeros((len(a) + 1, doubled.sum() + 1))
    ways[0, 0] = 1
    for rank in doubled:
        ways[1:, rank:] += ways[:-1, : ways.shape[1] - rank].copy()
    row = ways[len(a)]
    return float(row[doubled[: len(a)].sum() :].sum() / row.sum())


def binomial_p(k: int, n: int, p: float) -> float:
    """P(at least k of n)."""
    return math.fsum(math.comb(n, i) * p**i * (1 - p) ** (n - i) for i in range(k, n + 1))


def pairs_p(a: Sequence[float], b: Sequence[float]) -> float:
    """Hoeffding's bound against "A wins or ties with at least the margin"."""
    u = float((np.array(a)[:, None] >= np.array(b)).mean())
    if u >= MARGIN:
        return 1.0
    kl = (u * math.log(u / MARGIN) if u else 0.0) + (1 - u) * math.log((1 - u) / (1 - MARGIN))
    return math.exp(-min(len(a), len(b)) * kl)


def greater(a: Sequence[float], b: Sequence[float]) -> Ps:
    """P values of A above B."""
    size = pairs_p(a, b)
    return rank_p(a, b), min(rank_p(b, a), max(size, pairs_p(b, a))), size


def sign_ps(toward: int, away: int, n: int) -> Ps:
    """Sign tests each way."""
    return binomial_p(toward, n, 0.5), binomial_p(away, n, 0.5), None


def slope(row: Sequence[float]) -> int:
    """Pairs of levels that rise, less those that fall."""
    return int(sum(np.sign(y - x) for x, y in combinations(row, 2)))


def find(plain: Mapping[str, Any], records: Records, n: int, alpha: float) -> Ps:
    """Return the p values of an assertion by the first `n` trials a condition."""
    kind = plain["kind"]
    if kind in ("all of", "any of"):
        parts = [find(part, records, n, alpha) for part in plain["parts"]]
        every, some = max, lambda ps: min(1.0, len(ps) * min(ps))
        support, refute = (every, some) if kind == "all of" else (some, every)
        sizes = [against if size is None else min(against, size) for _, against, size in parts]
        sized = any(size is not None for *_, size in parts)
        return support([p[0] for p in parts]), refute([p[1] for p in parts]), refute(sizes) if sized else None
    if kind == "greater":
        return greater(records.of(plain["above"], n), records.of(plain["below"], n))
    if kind in ("solves", "stays"):
        k, p0 = int(sum(records.of(plain["event"], n))), P0 if plain["p0"] is None else plain["p0"]
        return binomial_p(k, n, p0), binomial_p(n - k, n, 1 - p0), None
    if kind == "exact":
        holds = all(records.of(plain["event"], n))
        return (0.0, 1.0, None) if holds else (1.0, 0.0, None)
    if kind == "band":
        values = np.array(records.of(plain["measure"], n))
        below, above = int((values < plain["lo"]).sum()), int((values > plain["hi"]).sum())
        inside = max(binomial_p(n - below, n, 0.5), binomial_p(n - above, n, 0.5))
        return inside, min(1.0, 2 * min(binomial_p(below, n, 0.5), binomial_p(above, n, 0.5))), None
    if kind == "threshold":
        sign = 1 if plain["side"] == "above" else -1
        values = sign * (np.array(records.of(plain["measure"], n)) - plain["number"])
        return sign_ps(int((np.isfinite(values) & (values > 0)).sum()), int((values < 0).sum()), n)
    if kind == "trend":
        sign = -1 if plain["direction"] == "falls" else 1
        trials = records.trials[plain["profile"]["condition"]]
        slopes = [sign * slope(trials[seed]["levels"][plain["profile"]["name"]]) for seed in range(n)]
        return sign_ps(sum(s > 0 for s in slopes), sum(s < 0 for s in slopes), n)
    if kind == "equivalent":
        a, b = (np.array(records.of(plain[side], n)) for side in ("left", "right"))
        up, down = (np.round(a + sign * plain["margin"], 9) for sign in (1, -1))
        b = np.round(b, 9)
        return max(rank_p(up, b), rank_p(b, down)), min(1.0, 2 * min(rank_p(b, up), rank_p(down, b))), None
    if kind == "self-comparison":
        values = np.array(records.of(plain["measure"], n))
        halves = [list(half) for half in combinations(range(n), n // 2)]
        found = sum(outcome(greater(values[half], np.delete(values, half)), alpha) == "supported" for half in halves)
        return (0.0, 1.0, None) if found / len(halves) <= alpha else (1.0, 0.0, None)
    raise LookupError(f"no kind {kind!r}: add it here")


def outcome(ps: Ps, alpha: float) -> str:
    """Return the outcome at a look."""
    supported, refuted, smaller = (p is not None and p <= alpha for p in ps)
    if supported:
        return "smaller than claimed" if smaller else "inconclusive" if refuted else "supported"
    return "refuted" if refuted else "smaller than claimed" if smaller else "inconclusive"


def needs_all(plain: Mapping[str, Any]) -> bool:
    """Whether an assertion is judged at the last look only."""
    return plain["kind"] in ("exact", "self-comparison") or any(map(needs_all, plain.get("parts", ())))


def judge(plain: Mapping[str, Any], records: Records, looks: Sequence[tuple[int, float]]) -> tuple[str, int, Ps]:
    """Return outcome, trials a side and p values: of the first look that decides, else of the last one."""
    smaller = None
    ending = "inconclusive", 0, (1.0, 1.0, None)
    for n, alpha in looks[-1:] if needs_all(plain) else looks:
        try:
            ps = find(plain, records, n, alpha)
        except KeyError:  # what a look has left open beyond doubt is not run on
            break
        ending = outcome(ps, alpha), n, ps
        if ending[0] == "smaller than claimed":
            smaller = smaller or ending
        elif ending[0] == "refuted" or (ending[0] == "supported" and smaller is None):
            return ending
    return smaller or ending
