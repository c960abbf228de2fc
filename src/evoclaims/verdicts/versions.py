"""The versions of packages that trials were made with, and their changes, in words."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from evoclaims.core.packages import Versions, differences, recorded
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
