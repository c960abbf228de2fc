"""The order of a run's claims, whose trials this process runs one after the other, or several processes ahead of it.

Nothing heavy is imported here at the top: pytest loads this file in every run of an environment that has evoclaims.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

import pytest

from evoclaims.core.errors import UserError
from evoclaims.execution.host import gpus
from evoclaims.plugin.options import AHEAD, make_session
from evoclaims.plugin.progress import progress_of

if TYPE_CHECKING:
    from evoclaims.claims.claim import ClaimTest
    from evoclaims.claims.session import Session
    from evoclaims.claims.workload import Workload

_OTHER_ORDERS: Final = ("failedfirst", "newfirst", "stepwise")
"""Options that ask for an order of tests, or depend on it."""


def prepare(session: pytest.Session, tests: dict[pytest.Item, ClaimTest]) -> None:
    """Find out what the collected claims need, put them in order, and let their trials begin.

    A worker of pytest-xdist keeps the order that it is given, and runs what its claims need.

    Raises:
        UserError: when no claim can be judged, or workers of pytest-xdist would share GPUs.
    """
    from evoclaims.claims.workload import soonest_first, workload

    config = session.config
    if hasattr(config, "workerinput"):
        _refuse_shared_gpus(config)  # before jax takes their memory
    judging = make_session(config)
    if hasattr(config, "workerinput"):
        return
    ahead = config.stash.get(AHEAD, None)
    load = workload(judging, tests, ahead.platform if ahead else None)
    if load is None:
        return
    if ahead is None:
        claims, workers = soonest_first(load), 1
    else:
        seeds = {tier: judging.design(tier).seeds(judging.design(tier).last.n) for tier in judging.reproduction.tiers}
        _note_outdated(judging, load, seeds)
        claims, workers = ahead.start(load, seeds), ahead.processes
    line = progress_of(config)
    if line is not None:
        line.begin(load, workers, tick=ahead is not None)
    if not any(config.getoption(name, False) for name in _OTHER_ORDERS):
        session.items[:] = in_order(session.items, claims)


def _note_outdated(judging: Session, load: Workload, seeds: Mapping[str, Sequence[int]]) -> None:
    """Note which trials are run again because of their versions, before other processes have run them."""
    from evoclaims.claims.fetching import RunMissing

    if isinstance(judging.fetch, RunMissing):
        for work in load.conditions.values():
            condition = judging.reproduction.tier(work.tiers[0], judging.variant).condition(*work.names)
            due = {seed for tier in work.tiers for seed in seeds[tier]}
            judging.fetch.note_outdated(condition, [seed for seed in work.missing if seed in due])


def in_order(items: list[pytest.Item], claims: list[str]) -> list[pytest.Item]:
    """Return tests with the claims in this order: they change places among themselves, all others stay."""
    first: dict[str, pytest.Item] = {}
    for item in items:
        first.setdefault(item.nodeid, item)
    due, ordered = iter(claims), []
    for item in items:  # a plugin's repetition of a claim stays, too
        is_claim = item.nodeid in claims and first[item.nodeid] is item
        ordered.append(first[next(due)] if is_claim else item)
    return ordered


def _refuse_shared_gpus(config: pytest.Config) -> None:
    several = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1")) > 1
    if several and not config.getoption("claims_stored") and gpus(config.getoption("claims_device")):
        raise UserError(
            "Each worker of pytest-xdist would take the memory of this host's GPUs. Leave out -n, and share them by "
            "--claims-processes auto."
        )
