"""The trials of one condition behind a claim, and the versions of packages that they were made with."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

from evoclaims.core.packages import Versions, installed
from evoclaims.verdicts.versions import Several, different


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
