"""What a run of claims has to do: the conditions that each claim needs, and what is known of how long they take."""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from statistics import median
from typing import Any, Final

import pytest

from evoclaims.claims.claim import gap_of
from evoclaims.claims.collected import TIER, ClaimTest
from evoclaims.claims.fetching import NotStoredError, RunMissing
from evoclaims.claims.session import Session, Verdicts
from evoclaims.core.errors import UserError
from evoclaims.core.provenance import machine_class
from evoclaims.judging.assertion import Assertion
from evoclaims.paper import references
from evoclaims.paper.recorded_batches import took
from evoclaims.paper.spent import spent
from evoclaims.paper.trial_group import TrialGroup
from evoclaims.trials import devices
from evoclaims.trials.batches import StoredTrials
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Condition, TrialSpec
from evoclaims.trials.store import DamagedFileError, Store

LONG: Final = 10**9
"""Environment steps that take a processor's core ten minutes or more."""


@dataclass(frozen=True)
class Work:
    """A condition that claims of a run need.

    Attributes:
        label: its name in claims, such as "cma_es on n_parity".
        programs: what it has in common with conditions that probably share its compiled programs.
        environment_steps: of the missing trials, at most.
        stored: how many of its trials need not be run.
        missing: files of the records of those that must be run, below the store's folder.
        here: seconds that the missing trials will take, or all if none is missing, by stored trials of this machine;
            None where there are none.
        elsewhere: the same by the committed reference trials, whatever machine they were made on.
        core_seconds: of a processor's core that the missing trials take at most, at the pace of reference trials of any
            tier; None on an accelerator, for short work, and where no such trial was made on a processor.
    """

    label: str
    programs: str
    environment_steps: int
    stored: int
    missing: tuple[str, ...]
    here: float | None
    elsewhere: float | None
    core_seconds: float | None = None


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


def workload(session: Session, tests: Mapping[pytest.Item, ClaimTest]) -> Workload | None:
    """Return what a run of these claim tests has to do; None for a session that runs nothing."""
    if not isinstance(session.fetch, RunMissing):
        return None
    platform = devices.choose(session.fetch.device)[0].platform
    claims, works = dict[str, tuple[str, ...]](), dict[str, Work]()
    once = {test.key: (item, test) for item, test in reversed(tests.items())}  # plugins may repeat tests
    for item, test in reversed(once.values()):
        claims[item.nodeid] = ()
        with suppress(Exception):  # an error of a method or a task is reported when the claim is judged
            groups = {group.fingerprint: group for group in _needed(session, item, test)}
            for condition_id in groups if test.third_look else groups.keys() - works.keys():
                works[condition_id] = _work(session, session.fetch, test, groups[condition_id], platform)
            claims[item.nodeid] = tuple(groups)
    return Workload(str(session.store.root.resolve()), claims, works)


def weights(works: Iterable[Work]) -> dict[Work, float]:
    """Return about how many seconds each condition takes, as far as it can be guessed, to tell long from short ones.

    Without a timing, its environment steps are used, at the middle pace of the others.
    """
    works = list(works)
    scale = scale_of((work.here, work.elsewhere) for work in works) or 1.0
    known = {work: seconds_of(work.here, work.elsewhere, scale) for work in works if work.missing}
    paces = [took / work.environment_steps for work, took in known.items() if took and work.environment_steps]
    pace = median(paces) if paces else 1e-6
    return dict.fromkeys(works, 0.0) | {
        work: work.environment_steps * pace if took is None else took for work, took in known.items()
    }


def core_seconds(works: Iterable[Work]) -> tuple[float, bool]:
    """Return the seconds of a processor's core that long work takes, and whether they are known of all of it."""
    long = [work for work in works if work.environment_steps >= LONG]
    return sum(work.core_seconds or 0.0 for work in long), all(work.core_seconds is not None for work in long)


def scale_of(pairs: Iterable[tuple[float | None, float | None]]) -> float | None:
    """Return how many times as long conditions take here as elsewhere, from those known for both; None without any."""
    both = [(here, elsewhere) for here, elsewhere in pairs if here and elsewhere]
    return sum(here for here, _ in both) / sum(elsewhere for _, elsewhere in both) if both else None


def seconds_of(here: float | None, elsewhere: float | None, scale: float | None) -> float | None:
    """Return a condition's seconds here, where trials tell: those of here, or else of elsewhere (see `scale_of`)."""
    if here is not None:
        return here
    return None if elsewhere is None or scale is None else elsewhere * scale


def _needed(session: Session, item: pytest.Item, test: ClaimTest) -> Sequence[TrialGroup]:
    """Return the trials that a claim needs: its test is called once, as far as it gets without trials.

    Nothing is known of a test with fixtures of its own, which are for the run itself. What a test raises is reported
    when it is run.
    """
    found: list[TrialGroup] = []
    judged: list[Assertion] = []

    def keep(assertion: Assertion, readings: object) -> Assertion:
        judged.append(assertion)
        return assertion

    def trials(method: str, *, on: str) -> TrialGroup:
        found.append(replace(session.group(method, on, test.tier), get=_never))
        return found[-1]

    function: Callable[..., Any] = item.obj  # type: ignore[attr-defined]
    given = {**item.callspec.params, TIER: test.tier, "trials": trials, "verdict": Verdicts(keep)}  # type: ignore[attr-defined]
    names = inspect.signature(function).parameters
    if gap_of(item, test.tier) or not set(names) <= set(given):
        return ()
    try:
        with warnings.catch_warnings(action="ignore"):
            function(**{name: given[name] for name in names})
    except KeyboardInterrupt:
        raise
    except BaseException:  # noqa: S110  (pytest's own outcomes, such as a skip, are no `Exception`)
        pass
    if isinstance(item.parent, pytest.Class):  # the run needs a new object of its class
        vars(item).pop("_instance", None)
        vars(item).pop("_obj", None)
    if not judged:
        return found
    # A condition that only another reading of the sentence asks for is not run.
    needed = {source.fingerprint for source in judged[0].sources()}
    return () if session.leaves(test.tier, judged[0]) else [one for one in found if one.fingerprint in needed]


def _never(condition: Condition, seeds: Sequence[int]) -> Sequence[TrialResult]:
    """Have no trials."""
    raise NotStoredError(f"{condition.label} is not run yet")


def _work(session: Session, fetch: RunMissing, test: ClaimTest, group: TrialGroup, platform: str) -> Work:
    """Look up what is known of a condition."""
    condition, versions, tier = group.condition, group.condition.versions, test.tier
    design = session.design(tier, third_look=test.third_look)
    seeds = design.seeds(design.last.n)
    stored = StoredTrials(session.store, condition, fetch.any_version, fetch.time_limit)
    missing = stored.missing(seeds) if condition.existing is None else []
    timed = len(missing) or len(seeds)
    steps = condition.environment_steps * len(missing)
    here, elsewhere, slow = took(_made_here(session.store, condition, seeds), platform), None, None
    with suppress(UserError):  # errors of the reference trials are reported at the end of the run
        folder = session.reproduction.references
        elsewhere = took(references.of_condition(folder, tier, group.method, group.task, condition.id), platform)
        if platform == "cpu" and steps >= LONG:
            cost = spent(session.reproduction, tier, group.method, group.task, session.variant)
            slow = cost.core_seconds(steps)
    files = (session.store.record_path(TrialSpec(condition, seed).id, versions) for seed in missing)
    return Work(
        label=group.label,
        programs=condition.programs,
        environment_steps=steps,
        stored=len(seeds) - len(missing),
        missing=tuple(str(path.relative_to(session.store.root)) for path in files),
        here=None if here is None else here.seconds(timed),
        elsewhere=None if elsewhere is None else elsewhere.seconds(timed),
        core_seconds=slow,
    )


def _made_here(store: Store, condition: Condition, seeds: Sequence[int]) -> Iterator[TrialResult]:
    """Return a condition's stored trials of this kind of machine, made with any versions."""
    machine = machine_class()
    for seed in seeds:
        with suppress(DamagedFileError):
            for record in store.records(TrialSpec(condition, seed).id):
                if record.provenance.get("machine") == machine:
                    yield record
