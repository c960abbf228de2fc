"""Assertions put to null agents: those that one satisfies say nothing about what was learnt.

An agent takes the place of all conditions of an assertion; and, unless it stands everywhere, of the claimed ones alone:
all but those that are only the worse side of comparisons. So "A is better than B" is also put to the agent against B's
own trials, and not to A's against the agent, which A should beat.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
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

Answer = bool | str
"""Whether an agent satisfies an assertion; a clause that says why it could not be asked."""


def answers(
    agents: Mapping[str, NullAgent],
    assertion: Assertion,
    look: Look,
    design: Design,
    trials: Fetch,
    others: OtherTrials | None,
) -> dict[str, Answer]:
    """Return by name whether the trials of null agents support an assertion at one look, or why that is not known.

    Args:
        agents: by name.
        assertion: what is put to them.
        look: trials per side, and the significance level.
        design: the margins and the first seed.
        trials: gets those of sources.
        others: trials of agents that are methods; None leaves these agents out.
    """
    once = replace(design, looks=(look,))
    return {name: _answer(agent, assertion, once, trials, others) for name, agent in agents.items()}


def claimed(assertion: Assertion) -> frozenset[str]:
    """Return the fingerprints of the conditions that an assertion does not only compare others with."""
    parts = assertion.parts if isinstance(assertion, Compound) else (assertion,)
    found: set[str] = set()
    for part in parts:
        if isinstance(part, Compound):
            found |= claimed(part)
        elif isinstance(part, Greater):
            found.add((part.below if part.above.better == "lower" else part.above).source.fingerprint)
        else:
            found |= {source.fingerprint for source in part.sources()}
    return frozenset(found)


def _answer(
    agent: NullAgent, assertion: Assertion, design: Design, trials: Fetch, others: OtherTrials | None
) -> Answer:
    """Return an agent's answer in any of its places; it was asked if it could be in one of them."""
    if agent.method and others is None:
        return "only stored trials are asked for"
    every = frozenset(source.fingerprint for source in assertion.sources())
    places = [every] if agent.everywhere else [every, claimed(assertion)]
    found = [_supported(agent, place, assertion, design, trials, others) for place in places]
    return True in found or (False not in found and found[0])


def _supported(
    agent: NullAgent,
    place: Collection[str],
    assertion: Assertion,
    design: Design,
    trials: Fetch,
    others: OtherTrials | None,
) -> Answer:
    """Whether an assertion is supported with an agent in the place of some conditions, or why it cannot be there."""

    def fetch(source: Source, seeds: tuple[int, ...]) -> tuple[TrialResult, ...]:
        if source.fingerprint not in place:
            return trials(source, seeds)
        if others is not None and agent.method and isinstance(source, TrialGroup):
            other = others(agent.method, source.task)
            known = not (source.condition.existing or other.condition.existing)  # a table only names its task
            if known and agent.meets(other.condition.task) != agent.meets(source.condition.task):
                raise NotStoredError("it is run on another instance of the task")
            return trials(other, design.seeds(len(seeds), bool(other.condition.existing)))
        return _trials(agent, source, seeds)

    try:
        ending = decide(assertion, design, fetch)
    except NotStoredError as error:
        return str(error)
    except UnknownNameError:
        return "it is not run on the task"
    if ending is None:
        return "there are too few trials"
    if ending.outcome is Outcome.ERROR:  # "There is no 'reward' in the finished trial of ...", say
        lacking = ending.note.partition(" in the finished trial")[0]
        return f"{lacking[:1].lower()}{lacking[1:]}"
    if ending.finding is None:
        return "too many trials are copies of each other"
    return ending.outcome is Outcome.SUPPORTED


def _trials(agent: NullAgent, source: Source, seeds: Sequence[int]) -> tuple[TrialResult, ...]:
    """Return trials with an agent's own numbers in the place of a condition's.

    Raises:
        NotStoredError: when it has none.
    """
    numbers = agent.numbers(source.condition) if agent.numbers and isinstance(source, TrialGroup) else None
    if not isinstance(source, TrialGroup) or numbers is None:
        raise NotStoredError("it cannot stand for the conditions")
    whole = {part: dict(numbers.get(part, {})) for part in PARTS}
    return tuple(record(TrialSpec(source.condition, seed), whole) for seed in seeds)
