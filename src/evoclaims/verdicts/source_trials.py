"""The trials of one condition behind a claim, and the versions of packages that they were made with."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from evoclaims.core.packages import Versions, differences, installed, recorded
from evoclaims.trials.result import TrialResult

Several = Mapping[str, tuple[str | None, ...]]
"""Different versions by package; None if not installed."""


def found_in(trials: Iterable[TrialResult], packages: tuple[str, ...]) -> Several:
    """Return the different versions of packages that trials were made with."""
    made_with = [recorded(trial.provenance, packages) for trial in trials]
    names = dict.fromkeys([*packages, *(name for versions in made_with for name in versions)])
    return {name: different(versions.get(name) for versions in made_with) for name in names}


def change(old: Versions, new: Versions) -> str:
    """Describe which versions differ, such as "evosax 0.3.2 -> 0.3.3"; empty when none does."""
    moved = differences(old, new).items()
    return ", ".join(f"{name} {was or 'none'} -> {now or 'none'}" for name, (was, now) in moved)


def moved(was: Several, now: Several) -> str:
    """Describe which versions differ, such as "evosax 0.3.2 -> 0.3.3", of the packages that both have."""
    names = [name for name in sorted(was.keys() & now.keys()) if was[name] != now[name]]
    return ", ".join(f"{name} {in_words(was[name])} -> {in_words(now[name])}" for name in names)


def in_words(versions: Iterable[str | None]) -> str:
    """Return versions as one text."""
    return " and ".join(version or "none" for version in versions)


def different(versions: Iterable[str | None]) -> tuple[str | None, ...]:
    """Return different versions in order; None (not installed) comes first."""
    return tuple(sorted(set(versions), key=lambda version: (version is not None, str(version))))


@dataclass(frozen=True)
class SourceTrials:
    """A condition that a claim is about, with the trials that were judged.

    Attributes:
        method, task: the names by which the claim asked for them.
        condition: its id.
        trials: their ids.
        versions: the different versions that the trials were made with, by package that it depends on.
        again: seeds that this run repeated because the store's trials were made with other versions.
        edited: the project's classes whose code the trials ran otherwise than it is now.
        reads: what the claim reads of each trial, such as "metrics.stones" and "levels.success".
    """

    method: str
    task: str
    condition: str
    trials: tuple[str, ...]
    versions: Several
    again: tuple[int, ...]
    edited: tuple[str, ...] = ()
    reads: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """A short name, such as "cma_es on n_parity"."""
        return f"{self.method} on {self.task}"

    @property
    def installed(self) -> Versions:
        """The installed versions of the packages that it depends on.

        If a trial has several records, the one with these versions was judged.
        """
        return installed(tuple(self.versions))


def versions_of(sources: Iterable[SourceTrials]) -> Several:
    """Return the different versions, by package, that all sources' trials were made with."""
    found: dict[str, list[str | None]] = defaultdict(list)
    for source in sources:
        for name, versions in source.versions.items():
            found[name] += versions
    return {name: different(versions) for name, versions in sorted(found.items())}
