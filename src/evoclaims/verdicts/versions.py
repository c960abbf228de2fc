"""The versions of packages that trials were made with, and their changes, in words."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from evoclaims.core.packages import Versions, differences, installed, recorded
from evoclaims.trials.result import TrialResult


def found_in(trials: Iterable[TrialResult], packages: tuple[str, ...]) -> dict[str, list[str | None]]:
    """Return the different versions of packages that trials were made with; None for what was not installed."""
    made_with = [recorded(trial.provenance, packages) for trial in trials]
    return {name: different(versions[name] for versions in made_with) for name in packages}


def of_sources(sources: Sequence[Mapping[str, Any]]) -> dict[str, list[str | None]]:
    """Return the different versions, by package, that the sources of a claim's report tell of."""
    found: dict[str, list[str | None]] = defaultdict(list)
    for source in sources:
        for name, versions in (source.get("versions") or {}).items():
            found[name] += versions
    return {name: different(versions) for name, versions in sorted(found.items())}


def installed_for(source: Mapping[str, Any]) -> dict[str, str | None]:
    """Return the installed versions of the packages that a source of a claim's report depends on.

    Of several records of its trials the one with these versions is the one that was judged.
    """
    return installed(tuple(source.get("versions") or ()))


def change(old: Versions, new: Versions) -> str:
    """Return in words which versions differ, such as "evosax 0.3.2 -> 0.3.3"; empty when none does."""
    moved = differences(old, new).items()
    return ", ".join(f"{name} {was or 'none'} -> {now or 'none'}" for name, (was, now) in moved)


def in_words(versions: Iterable[str | None]) -> str:
    """Return versions as one text."""
    return " and ".join(version or "none" for version in versions)


def different(versions: Iterable[str | None]) -> list[str | None]:
    """Return different versions in order; what was not installed comes first."""
    return sorted(set(versions), key=lambda version: (version is not None, str(version)))
