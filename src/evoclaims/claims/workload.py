"""What a run of claims has to do: the conditions that each claim needs, in which order, and how far the run is."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from evoclaims.claims.claim import ClaimTest
from evoclaims.claims.collected import Collected, Recorder
from evoclaims.claims.fetching import RunMissing
from evoclaims.claims.session import Session
from evoclaims.paper.cost import Cost, Estimator, Wanted
from evoclaims.paper.reproduction import Names
from evoclaims.paper.trial_group import TrialGroup
from evoclaims.trials import devices
from evoclaims.trials.devices import usable_cores
from evoclaims.trials.lease import Running, running
from evoclaims.trials.spec import TrialSpec
from evoclaims.trials.store import DamagedFileError, Store


@dataclass(frozen=True)
class Work:
    """A condition that claims of a run need.

    Attributes:
        names: under which claims ask for it.
        tiers: of these claims; the names are those of the first.
        programs: what it has in common with conditions that probably share its compiled programs.
        stored: how many of its trials need not be run.
        missing: those that must be run: by seed, the file of the record, below the store's folder.
        cost: of the missing trials, or of all if none is missing.
    """

    names: Names
    tiers: tuple[str, ...]
    programs: str
    stored: int
    missing: Mapping[int, str]
    cost: Cost

    @property
    def label(self) -> str:
        """A name such as "cma_es on n_parity"."""
        return " on ".join(self.names)

    @property
    def seconds(self) -> float:
        """About how long it takes, to tell long from short ones."""
        return self.cost.seconds() if self.missing else 0.0


@dataclass(frozen=True)
class Workload:
    """The claims of a run, and the conditions that they need.

    Attributes:
        storage: the store's folder.
        claims: ids of the conditions that each claim needs, by the name of its test; empty where nothing is known.
        conditions: by id.
    """

    storage: str
    claims: Mapping[str, tuple[str, ...]]
    conditions: Mapping[str, Work]


@dataclass
class _Need:
    """What claims ask of a condition: for which seeds, at which tiers, and as which group of the first of these."""

    group: TrialGroup
    tiers: dict[str, None] = field(default_factory=dict)
    seeds: set[int] = field(default_factory=set)


def workload(session: Session, tests: Mapping[pytest.Item, ClaimTest], platform: str | None = None) -> Workload | None:
    """Return what a run of these claim tests has to do; None for a session that runs nothing.

    Trials run on this `platform`; None for that of this process.
    """
    if not isinstance(session.fetch, RunMissing):
        return None
    claims, needs = dict[str, tuple[str, ...]](), dict[str, _Need]()
    recorder = Recorder.of(session)
    once: dict[tuple[str, str], tuple[pytest.Item, ClaimTest]] = {}
    for item, test in tests.items():  # plugins may repeat tests
        once.setdefault(test.key, (item, test))
    for item, test in once.values():
        claims[item.nodeid] = ()
        with suppress(Exception):  # an error of a method or a task is reported when the claim is judged
            design = session.design(test.tier, test.third_look)
            needed = {group.fingerprint: group for group in _needed(session, recorder.call(item, test))}
            for condition, group in needed.items():
                _ = group.condition.environment_steps
                need = needs.setdefault(condition, _Need(group))
                need.tiers.setdefault(test.tier)
                need.seeds.update(design.seeds(design.last.n))
            claims[item.nodeid] = tuple(needed)
    platform = platform or devices.choose(session.fetch.device)[0].platform
    works: dict[str, Work] = {}
    for tier in session.reproduction.tiers:
        of_tier = {condition: need for condition, need in needs.items() if next(iter(need.tiers)) == tier}
        works |= _works(session, session.fetch, tier, of_tier, platform)
    return Workload(str(session.store.root.resolve()), claims, works)


def _needed(session: Session, one: Collected) -> Sequence[TrialGroup]:
    """Return the trials that a claim needs, as far as its test gets without trials."""
    if one.assertion is None:
        return one.asked
    # A condition that only another reading of the sentence asks for is not run.
    needed = {source.fingerprint for source in one.assertion.sources()}
    leaves = session.leaves(one.test.tier, one.assertion)
    return () if leaves else [group for group in one.asked if group.fingerprint in needed]


def _works(
    session: Session,
    fetch: RunMissing,
    tier: str,
    needs: Mapping[str, _Need],
    platform: str,
) -> dict[str, Work]:
    wanted: dict[str, Wanted] = {}
    for name, need in needs.items():
        group, seeds = need.group, sorted(need.seeds)
        known = [*seeds, *fetch.more(group.condition, seeds)]
        wanted[name] = Wanted((group.method, group.task), group.condition, known)
    store, paper = session.store, session.reproduction
    estimator = Estimator(store, paper, tier, platform, time_limit=fetch.time_limit, any_version=fetch.any_version)
    works = {}
    for name, owed in estimator.owed(wanted).items():
        names, condition = wanted[name].names, wanted[name].condition
        files = {seed: store.record_path(TrialSpec(condition, seed).id, condition.versions) for seed in owed.seeds}
        missing = {seed: str(path.relative_to(store.root)) for seed, path in files.items()}
        stored, tiers = len(wanted[name].seeds) - len(missing), tuple(needs[name].tiers)
        works[name] = Work(names, tiers, condition.programs, stored, missing, owed.cost)
    return works


def soonest_first(load: Workload) -> list[str]:
    """Return the claims in the order for one process: each time the one whose missing trials take the least.

    Of two that take the same, one whose trials are not known comes later.
    """
    left, begun, ordered = list(load.claims), set[str](), list[str]()

    def rank(claim: str) -> tuple[float, bool]:
        needs = load.claims[claim]
        return sum(load.conditions[name].seconds for name in needs if name not in begun), not needs

    while left:
        claim = min(left, key=rank)
        left.remove(claim)
        begun.update(load.claims[claim])
        ordered.append(claim)
    return ordered


@dataclass(frozen=True)
class Overview:
    """How far a run of claims is.

    Attributes:
        judged: claims, of `claims`.
        done: trials in the store, of the `trials` that the claims need at most.
        running: the batches under way.
        seconds_left: about how long the run will still take; None without a timing from this machine.
    """

    judged: int
    claims: int
    done: int
    trials: int
    running: Sequence[Running]
    seconds_left: float | None


class Watching:
    """Looks now and then how far a run is."""

    def __init__(self, load: Workload, workers: int) -> None:
        """Begin with what was known before the run."""
        self._load = load
        self._workers = workers
        self._store = Store(Path(load.storage))
        self._waiting = set(load.claims)
        self._missing = {name: list(work.missing.values()) for name, work in load.conditions.items()}
        share = max(usable_cores() // workers, 1)
        self._seconds = {name: work.cost.seconds(share) for name, work in load.conditions.items()}
        self._took: dict[str, float] = {}

    def judged(self, claim: str) -> None:
        """Note that a claim has been judged."""
        self._waiting.discard(claim)

    def look(self) -> Overview:
        """Look into the store."""
        conditions = self._load.conditions
        for name, files in self._missing.items():
            left = [file for file in files if not (self._store.root / file).exists()]
            if files and not left:
                self._learn(name)
            self._missing[name] = left
        owed = {name for claim in self._waiting for name in self._load.claims[claim] if self._missing[name]}
        done = sum(work.stored + len(work.missing) - len(self._missing[name]) for name, work in conditions.items())
        now = [self._named(one) for one in running(self._store.root)]
        return Overview(
            judged=len(self._load.claims) - len(self._waiting),
            claims=len(self._load.claims),
            done=done,
            trials=done + sum(len(self._missing[name]) for name in owed),
            running=now,
            seconds_left=self._seconds_left(owed, {one.condition: one for one in now}),
        )

    def _named(self, one: Running) -> Running:
        """Return a batch under the name that claims have for its condition."""
        work = self._load.conditions.get(one.condition)
        return one if work is None else replace(one, progress=replace(one.progress, condition=work.label))

    def _learn(self, name: str) -> None:
        """Note how long a condition took, whose last trial has been stored."""
        with suppress(DamagedFileError):
            record = self._store.read(self._store.root / [*self._load.conditions[name].missing.values()][-1])
            if record is not None:
                self._took[name] = float(record.timing["compile"]) + float(record.timing["run"])

    def _seconds_left(self, owed: Iterable[str], now: Mapping[str, Running]) -> float | None:
        """Return how long the workers will still take; None if a missing condition has no timing.

        Timings of other machines count as soon as a condition that they are of has ended here.
        """
        bases = {name: work.cost.basis for name, work in self._load.conditions.items()}
        compared = [name for name in self._took if bases[name] == "elsewhere"]
        whole = sum(self._seconds[name] for name in compared)
        scale = {"here": 1.0, "elsewhere": sum(self._took[name] for name in compared) / whole if whole else None}
        left: list[float] = []
        for name in owed:
            one = remaining(self._seconds[name], scale.get(bases[name]), now.get(name))
            if one is None:
                return None
            left.append(one)
        return max(sum(left) / min(self._workers, len(left)), *left) if left else None


def remaining(seconds: float, scale: float | None, now: Running | None) -> float | None:
    """Return about how many seconds a condition will still take; None without a timing from this machine.

    Args:
        seconds: the estimate for the whole.
        scale: how many times as long it takes here; None while unknown.
        now: the batch, if it is running: its own speed is the best estimate.
    """
    if now is not None and now.progress.seconds_left is not None:
        return now.progress.seconds_left
    if scale is None:
        return None
    return seconds * scale if now is None else max(seconds * scale - (time.time() - now.since), 0.0)
