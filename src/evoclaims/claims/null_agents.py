"""Assertions put to null agents: those that one satisfies say nothing about what was learnt.

An agent takes the place of all conditions of an assertion; and, unless it stands everywhere, of the claimed ones alone:
all but those that are only the lower side of comparisons. So "A is above B" is also put to the agent against B's own
trials, and not to A's against the agent, which A should beat.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

from evoclaims.claims.as_published import PARTS, record
from evoclaims.claims.fetching import NotStoredError
from evoclaims.core.errors import UnknownNameError
from evoclaims.judging.assertion import Assertion, Compound
from evoclaims.judging.design import Design, Look
from evoclaims.judging.judge import Fetch, decide
from evoclaims.judging.kinds.greater import Greater
from evoclaims.judging.sample import Source
from evoclaims.judging.verdict import Outcome
from evoclaims.paper.reproduction import NullAgent
from evoclaims.paper.trial_group import TrialGroup
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import TrialSpec

OtherTrials = Callable[[str, str], TrialGroup]
"""Returns the trials of a method on a task."""


def satisfied_by(
    agents: Mapping[str, NullAgent],
    assertion: Assertion,
    look: Look,
    design: Design,
    trials: Fetch,
    others: OtherTrials | None,
) -> tuple[str, ...]:
    """Return the names of the null agents whose trials support an assertion at one look.

    Args:
        agents: by name.
        assertion: what is put to them.
        look: trials per side, and the significance level.
        design: the margins and the first seed.
        trials: gets those of sources.
        others: trials of agents that are methods; None leaves these agents out.
    """
    once = replace(design, looks=(look,))
    return tuple(name for name, agent in agents.items() if _satisfies(agent, assertion, once, trials, others))


def claimed(assertion: Assertion) -> frozenset[str]:
    """Return the fingerprints of the conditions that an assertion does not only compare others with."""
    parts = assertion.parts if isinstance(assertion, Compound) else (assertion,)
    found: set[str] = set()
    for part in parts:
        if isinstance(part, Compound):
            found |= claimed(part)
        elif isinstance(part, Greater):
            found.add(part.above.source.fingerprint)
        else:
            found |= {source.fingerprint for source in part.sources()}
    return frozenset(found)


def _satisfies(
    agent: NullAgent, assertion: Assertion, design: Design, trials: Fetch, others: OtherTrials | None
) -> bool:
    if agent.method and others is None:
        return False
    every = frozenset(source.fingerprint for source in assertion.sources())
    places = {every} if agent.everywhere else {every, claimed(assertion)}
    return any(_supported(agent, place, assertion, design, trials, others) for place in places)


def _supported(
    agent: NullAgent,
    place: Iterable[str],
    assertion: Assertion,
    design: Design,
    trials: Fetch,
    others: OtherTrials | None,
) -> bool:
    """Whether an assertion is supported with an agent in the place of some conditions; False where it cannot be."""

    def fetch(source: Source, seeds: tuple[int, ...]) -> tuple[TrialResult, ...]:
        return _trials(agent, source, seeds, trials, others) if source.fingerprint in place else trials(source, seeds)

    try:
        ending = decide(assertion, design, fetch)
    except (NotStoredError, UnknownNameError):
        return False
    return ending is not None and ending.outcome is Outcome.SUPPORTED


def _trials(
    agent: NullAgent, source: Source, seeds: Sequence[int], trials: Fetch, others: OtherTrials | None
) -> tuple[TrialResult, ...]:
    """Return an agent's trials in the place of a condition's.

    Raises:
        NotStoredError: when it has none.
        UnknownNameError: when its method is not run on the task.
    """
    if not isinstance(source, TrialGroup):
        raise NotStoredError(f"{agent.says} cannot stand for {source.label}")
    if others is not None and agent.method:
        return trials(others(agent.method, source.task), tuple(seeds))
    numbers = agent.numbers(source.condition) if agent.numbers is not None else None
    if numbers is None:
        raise NotStoredError(f"{agent.says} cannot stand for {source.label}")
    whole = {part: dict(numbers.get(part, {})) for part in PARTS}
    return tuple(record(TrialSpec(source.condition, seed), whole) for seed in seeds)
