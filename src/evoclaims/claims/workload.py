"""What a run of claims has to do: the conditions that each claim needs, and what is known of how long they take."""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import pytest

from evoclaims.claims.claim import gap_of
from evoclaims.claims.collected import TIER, ClaimTest
from evoclaims.claims.fetching import NotStoredError, RunMissing
from evoclaims.claims.session import Session, Verdicts
from evoclaims.judging.assertion import Assertion
from evoclaims.paper.cost import Cost, Estimator, Wanted
from evoclaims.paper.trial_group import TrialGroup
from evoclaims.trials import devices
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Condition, TrialSpec


@dataclass(frozen=True)
class Work:
    """A condition that claims of a run need.

    Attributes:
        label: its name in claims, such as "cma_es on n_parity".
        programs: what it has in common with conditions that probably share its compiled programs.
        stored: how many of its trials need not be run.
        missing: files of the records of those that must be run, below the store's folder.
        cost: of the missing trials, or of all if none is missing.
    """

    label: str
    programs: str
    stored: int
    missing: tuple[str, ...]
    cost: Cost

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


def workload(session: Session, tests: Mapping[pytest.Item, ClaimTest]) -> Workload | None:
    """Return what a run of these claim tests has to do; None for a session that runs nothing."""
    if not isinstance(session.fetch, RunMissing):
        return None
    claims, groups = dict[str, tuple[str, ...]](), dict[str, dict[str, tuple[TrialGroup, Sequence[int]]]]()
    once: dict[tuple[str, str], tuple[pytest.Item, ClaimTest]] = {}
    for item, test in tests.items():  # plugins may repeat tests
        once.setdefault(test.key, (item, test))
    for item, test in once.values():
        claims[item.nodeid] = ()
        with suppress(Exception):  # an error of a method or a task is reported when the claim is judged
            design = session.design(test.tier, third_look=test.third_look)
            seeds, known = design.seeds(design.last.n), groups.setdefault(test.tier, {})
            needed = {group.fingerprint: group for group in _needed(session, item, test)}
            for condition, group in needed.items():
                _ = group.condition.environment_steps
                if condition not in known or len(known[condition][1]) < len(seeds):
                    known[condition] = group, seeds
            claims[item.nodeid] = tuple(needed)
    platform = devices.choose(session.fetch.device)[0].platform
    works: dict[str, Work] = {}
    for tier, known in groups.items():
        works |= _works(session, session.fetch, tier, known, platform)
    return Workload(str(session.store.root.resolve()), claims, works)


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


def _works(
    session: Session,
    fetch: RunMissing,
    tier: str,
    groups: Mapping[str, tuple[TrialGroup, Sequence[int]]],
    platform: str,
) -> dict[str, Work]:
    """Look up what is known of conditions of a tier."""
    wanted = {
        name: Wanted((group.method, group.task), group.condition, seeds) for name, (group, seeds) in groups.items()
    }
    store, paper = session.store, session.reproduction
    estimator = Estimator(store, paper, tier, platform, time_limit=fetch.time_limit, any_version=fetch.any_version)
    works = {}
    for name, owed in estimator.owed(wanted).items():
        (group, seeds), condition = groups[name], wanted[name].condition
        files = (store.record_path(TrialSpec(condition, seed).id, condition.versions) for seed in owed.seeds)
        missing = tuple(str(path.relative_to(store.root)) for path in files)
        works[name] = Work(group.label, condition.programs, len(seeds) - len(missing), missing, owed.cost)
    return works
