"""The tables of docs/findings.md, from the committed trials; run as a module, it writes them into the page."""

from __future__ import annotations

import functools
import re
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import fmean
from typing import Final

from evoclaims.core.errors import UserError
from evoclaims.judging.exact import rank_test
from evoclaims.judging.repetition import PublishedMean, repetition
from evoclaims.paper import references
from evoclaims.trials.result import TrialResult
from reproductions.nisioti2025 import REPRODUCTION

PAGE: Final = Path(__file__).parents[2] / "docs" / "findings.md"
FRESH: Final = Path(__file__).parent / "fresh"
"""Trials of fresh seeds (100 to 109), by variant; no verdict reads them."""
METHODS: Final = ("neat", "hyperneat", "cma_es", "map_elites", "ppo", "goal_ppo")
NOISE: Final = {"fixed_start": 0, "quarter_noise": 0.25, "half_noise": 0.5, "": 1}
TRIED: Final = 8
"""Composites tried, as the rule counts them (docs/protocol.md)."""
COMPOSITES: Final = ("submission", "submission_once", "submission_0.5", "submission_once_0.5")


def trials(variant: str, method: str, fresh: bool = False) -> Sequence[TrialResult]:
    """Return the committed trials of a method among stones under a variant, where it changes them; else none."""
    tier = REPRODUCTION.tier("full", variant)
    names = method, "stones"
    if variant and names not in REPRODUCTION.changed_by(variant, "full"):
        return ()
    if fresh:
        return references.committed(FRESH / variant, "full", *names)
    return _committed(method).get(tier.condition(*names).id, ())


@functools.cache
def _committed(method: str) -> dict[str, Sequence[TrialResult]]:
    """Return the reference trials of a method among stones, those of variants included, by condition."""
    found = defaultdict[str, dict[str, TrialResult]](dict)
    for path in sorted(REPRODUCTION.references.rglob(f"full/{method}-stones.jsonl")):
        for trial in references.load(path):
            found[trial.condition][trial.id] = trial
    return {condition: tuple(trials.values()) for condition, trials in found.items()}


def cell(found: Sequence[TrialResult]) -> str:
    """Return mean stones, and the mean reward of the best training episode divided by 1,000; – without trials."""
    if not found:
        return "–"
    stones = fmean(trial.metrics["stones"] for trial in found)
    best = fmean(trial.curves["fitness"][-1] for trial in found) / 1_000
    return f"{stones:.1f} ({best:.1f})" if best > 0.1 else f"{stones:.1f}"


def stones() -> Iterator[str]:
    """Yield a line for each variant that changes trials of NEAT, HyperNEAT or CMA-ES among stones, and has some."""
    yield "| | " + " | ".join(METHODS).replace("_", "\\_") + " |"
    yield "| --- " * (len(METHODS) + 1) + "|"
    for variant in ("", *REPRODUCTION.variants):
        for fresh in (False, True) if variant else (False,):
            cells = [cell(trials(variant, method, fresh)) for method in METHODS]
            if set(cells) != {"–"}:
                name = variant.replace("_", "\\_") or "the text's protocol"
                yield f"| {name}{', fresh seeds' * fresh} | {' | '.join(cells)} |"


def noise() -> Iterator[str]:
    """Yield NEAT's stones against the noise on starts, as far as it has run, each tested against the whole noise."""
    yield "| share of the code's noise on starts | NEAT's stones (training's best / 1,000) | p, more than with all |"
    yield "| --- | --- | --- |"
    whole = [trial.metrics["stones"] for trial in trials("", "neat")]
    for variant, share in NOISE.items():
        if found := trials(variant, "neat"):
            p = f"{rank_test([trial.metrics['stones'] for trial in found], whole).p:.2g}" if variant else "–"
            yield f"| {share:g} | {cell(found)} | {p} |"


def rule() -> Iterator[str]:
    """Yield, for each composite on fresh seeds, what the rule for a hit asks, as far as it has run."""
    yield "| composite | NEAT (5) | HyperNEAT (3) | CMA-ES (3) | p, NEAT above HyperNEAT | p, NEAT above CMA-ES | hit |"
    yield "| --- | --- | --- | --- | --- | --- | --- |"
    for variant in COMPOSITES:
        values = {
            method: [trial.metrics["stones"] for trial in trials(variant, method, fresh=True)]
            for method in ("neat", "hyperneat", "cma_es")
        }
        answers = [_answer(method, found) for method, found in values.items()]
        above = [rank_test(values["neat"], values[other]).p for other in ("hyperneat", "cma_es")]
        fails = "outside" in answers or max(above) > 0.05 / TRIED
        said = [f"{fmean(found):.1f}, {answer}" for found, answer in zip(values.values(), answers, strict=True)]
        told = [*said, *(f"{p:.2g}" for p in above), "no" if fails else "not decided: PPO has not run"]
        yield f"| {variant.replace('_', chr(92) + '_')} | {' | '.join(told)} |"


def _answer(method: str, ours: Sequence[float]) -> str:
    """Return whether the published number of stones lies where a repetition of it would be."""
    published = REPRODUCTION.published.value("stones", "stones", method)
    if published is None or published.trials is None:
        raise UserError(f"reported.toml has no number of stones of {method}, or not of how many trials.")
    mean = PublishedMean(published.value, published.error, published.trials, published.scale, published.precision)
    return str(repetition(mean, ours, len(ours)).answer)


def filled(page: str) -> str:
    """Return the page with each table written anew, from its mark to the next `<!-- findings: end -->`."""
    for name, lines in {"stones": stones, "noise": noise, "rule": rule}.items():
        block = re.compile(rf"(<!-- findings: {name} -->\n\n).*?(\n\n<!-- findings: end -->)", re.DOTALL)
        table = "\n".join(lines())
        page = block.sub(lambda found, table=table: f"{found[1]}{table}{found[2]}", page)  # type: ignore[misc]
    return page


if __name__ == "__main__":
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
