"""All trials at hand: those of the store, and the committed reference trials of a reproduction."""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from evoclaims.core.packages import Versions, agree
from evoclaims.paper import references
from evoclaims.paper.reproduction import Reproduction
from evoclaims.trials.failed import is_final
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Condition, TrialSpec
from evoclaims.trials.store import Store, newest


@dataclass(frozen=True)
class Archive:
    """All trials that can be judged, by id, from the store or committed, made with any versions.

    If a trial has several records, the one made with the requested versions comes first, from the store or committed;
    then the store's newest, then the committed one.

    Attributes:
        store: searched first; a trial that ran out of time there may be complete in `references`.
        references: folder of the committed reference trials, or None.
        existing: conditions whose trials exist already (see `Condition.existing`).
    """

    store: Store
    references: Path | None = None
    existing: tuple[Condition, ...] = ()

    def check(self) -> None:
        """Check before anything is judged that the store can be read, and that every line of reference trials is one.

        Whether a line was edited shows when its trial is read: a command that asks for few reads few.

        Raises:
            UserError: when something else is in the store's place, or a file of reference trials is damaged.
        """
        self.store.check()
        _ = self._files, self._imported

    def get(self, trial: str, versions: Versions | None = None) -> TrialResult | None:
        """Return the record of the trial with this id, if possible made with `versions` of its packages, or None.

        One that ran out of time, here or elsewhere, stands back behind every one that came to an end.

        Raises:
            UserError: when a record, or a file of reference trials, is damaged or edited.
        """
        here = None if versions is None else self.store.made_with(trial, versions)
        if is_final(here):
            return here
        committed = self._committed(trial)
        agreeing = next((one for one in committed if versions is not None and agree(one.provenance, versions)), None)
        if agreeing is not None:
            return agreeing
        records = self.store.records(trial)
        return newest(filter(is_final, records)) or newest(committed) or here or newest(records)

    def stored(self, trial: str, versions: Versions | None = None) -> TrialResult | None:
        """Return what `get` returns if it is a record of the store; None if it is a committed or an imported one."""
        found = self.get(trial, versions)
        return None if any(found is one for one in self._committed(trial)) else found

    def trials(self, condition: Condition, seeds: Sequence[int]) -> tuple[TrialResult | None, ...]:
        """Return a condition's trial for each seed, or None; this environment's records come first."""
        return tuple(self.get(TrialSpec(condition, seed).id, condition.versions) for seed in seeds)

    def _committed(self, trial: str) -> Sequence[TrialResult]:
        """Return the imported and the reference trials with this id."""
        files = [self._loaded(path).get(trial, ()) for path in self._files.get(trial, ())]
        return [*self._imported.get(trial, ()), *itertools.chain.from_iterable(files)]

    @cached_property
    def _files(self) -> dict[str, list[Path]]:
        """The files that have a reference trial, by its id."""
        found: dict[str, list[Path]] = defaultdict(list)
        for path in sorted(self.references.rglob("*.jsonl")) if self.references is not None else ():
            for trial in dict.fromkeys(references.ids(path)):
                found[trial].append(path)
        return dict(found)

    def _loaded(self, path: Path) -> dict[str, list[TrialResult]]:
        """Return the reference trials of a file by id; it is read once."""
        if path not in self._kept:
            self._kept[path] = _by_id(references.load(path))
        return self._kept[path]

    @cached_property
    def _kept(self) -> dict[Path, dict[str, list[TrialResult]]]:
        return {}

    @cached_property
    def _imported(self) -> dict[str, list[TrialResult]]:
        return _by_id(trial for condition in self.existing for trial in condition.existing)


def _by_id(trials: Iterable[TrialResult]) -> dict[str, list[TrialResult]]:
    found: dict[str, list[TrialResult]] = defaultdict(list)
    for trial in trials:
        found[trial.id].append(trial)
    return dict(found)


@dataclass(frozen=True)
class Name:
    """A name of a condition.

    Attributes:
        tier: "smoke" or "full".
        variant: its name; empty for the protocol itself.
        method, task: as claims name them.
    """

    tier: str
    variant: str
    method: str
    task: str


def names_of(reproduction: Reproduction) -> dict[str, tuple[Name, ...]]:
    """Return the names of every condition by its id; several if tiers or methods share it.

    A variant names only conditions that the protocol itself does not have; shared ones keep the protocol's name.
    """
    found: dict[str, tuple[Name, ...]] = {}

    def note(tier: str, variant: str, conditions: Mapping[tuple[str, str], Condition]) -> None:
        for (method, task), condition in conditions.items():
            found[condition.id] = (*found.get(condition.id, ()), Name(tier, variant, method, task))

    for tier, plan in reproduction.tiers.items():
        note(tier, "", plan.conditions)
    plain = set(found)
    for variant, changes in reproduction.variants.items():
        for tier, conditions in changes.conditions.items():
            note(tier, variant, {names: one for names, one in conditions.items() if one.id not in plain})
    return found
