"""Batches of trials as their records tell them: what ran together, and how long that took."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from evoclaims.trials.devices import layout_on
from evoclaims.trials.result import COMPLETE, TrialResult


@dataclass(frozen=True)
class RecordedBatch:
    """Trials that ran together, as their records say.

    Attributes:
        trials: at least one, each once.
        compile, run: seconds, until the last trial had ended.
        layout: see `program.over_trials`.
        processor: seconds of a processor's cores that running took; None where the records do not tell.
    """

    trials: Sequence[TrialResult]
    compile: float
    run: float
    layout: str
    processor: float | None

    @property
    def core_seconds(self) -> float | None:
        """Seconds of a processor's core; of a trial alone its running time, None for a batch of several without one."""
        return self.run if self.processor is None and len(self.trials) == 1 else self.processor

    def seconds(self, trials: int) -> float:
        """Return about how long so many trials of the same condition take."""
        return self.compile + self.run * (trials / len(self.trials) if self.layout == "alone" else 1)


def took(trials: Iterable[TrialResult], platform: str) -> RecordedBatch | None:
    """Return the largest batch among trials of one condition on a platform; None if no batch is known."""
    return largest(trial for trial in trials if trial.device.get("platform") == platform)


def largest(trials: Iterable[TrialResult]) -> RecordedBatch | None:
    """Return the largest batch of trials that came to an end; None if no batch is known."""
    ended = by_batch(trial for trial in trials if trial.status in COMPLETE)
    return max(ended, key=lambda batch: len(batch.trials), default=None)


def by_batch(trials: Iterable[TrialResult]) -> list[RecordedBatch]:
    """Return trials by batch, in the order of the first of each; a trial that is given twice counts once."""
    batches: dict[tuple[str, str], dict[str, TrialResult]] = defaultdict(dict)
    for trial in trials:
        batches[str(trial.timing["started"]), str(trial.device.get("kind"))][trial.id] = trial
    found = []
    for each in batches.values():
        together = list(each.values())
        compiling, running = (max(float(trial.timing[name]) for trial in together) for name in ("compile", "run"))
        layout = layout_on(str(together[0].device["platform"]))
        measured = [float(trial.timing["processor"]) for trial in together if "processor" in trial.timing]
        found.append(RecordedBatch(together, compiling, running, layout, max(measured, default=None)))
    return found
