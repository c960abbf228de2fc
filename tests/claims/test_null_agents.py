"""Assertions put to null agents: which agent satisfies which, and in whose place."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from evoclaims.claims.claim import Claim, ClaimTest
from evoclaims.claims.null_agents import answers
from evoclaims.claims.session import Session
from evoclaims.core.errors import UserError
from evoclaims.judging.assertion import Assertion
from evoclaims.judging.verdict import Outcome
from evoclaims.paper.reproduction import NullAgent, Reproduction, Variant
from evoclaims.trials.spec import Budget, Condition
from evoclaims.trials.store import Store
from evoclaims.verdicts.claim_report import CONTROL, ClaimReport


def _as_it_is(task: Any) -> Any:
    return task


Put = Callable[..., ClaimReport]


def _still(condition: Condition) -> Any:
    """Numbers of an agent that solves nothing; it cannot stand for the large task."""
    if condition.task.levels != 2:
        return None
    return {"metrics": {"mean_success": 0.4, "furthest_solved": -1.0, "last_success": 0.5}}


def _value(condition: Condition, seed: int) -> float:
    return seed / 100 if condition.method.negated else 0.5 + seed / 100  # type: ignore[attr-defined]


@pytest.fixture
def put(reproduction: Reproduction, store: Store, says: Claim, served: Any) -> Put:
    """A function that puts an assertion to agents, beside trials of which "better" has 0.5 to 0.59, "worse" to 0.09."""

    def judge(
        asserted: Callable[[Any], Assertion], where: str = "§1", variant: str = "", **agents: NullAgent
    ) -> ClaimReport:
        longer = replace(reproduction.tier("full").condition("better", "small"), budget=Budget(generations=3))
        paper = replace(
            reproduction,
            null_agents=agents or {"still": NullAgent("solves nothing", _still)},
            variants={"longer": Variant("", {"full": {("better", "small"): longer}})},
        )
        session = Session(paper, store, served(_value), variant=variant)

        def group(method: str, on: str = "small") -> Any:
            return session.group(method, on, "full")

        test = ClaimTest(replace(says, where=where), "full", "")
        return session.settle(test, asserted(group))

    return judge


def _stays(trials: Any, on: str = "small") -> Any:
    return trials("worse", on).does_not_solve_the_last_level.stays()


def _delay(trials: Any) -> Any:
    """A measure of which the worse have less, and agents most."""
    return trials.measure(
        "delay", lambda t: 9.0 if t.metrics["mean_success"] == 0.4 else t.metrics["mean_success"], "lower"
    )


@pytest.mark.parametrize(
    ("asserted", "answer"),
    [
        (_stays, True),
        (lambda trials: trials("better").solves_the_last_level.in_most_trials(), False),
        # It takes the place of the side that is claimed to be better, and not of the other one alone.
        (lambda trials: trials("better").mean_success > trials("worse").mean_success, True),
        (lambda trials: trials("worse").mean_success > trials("better").mean_success, False),
        (lambda trials: trials("worse").mean_success < trials("better").mean_success, True),
        (lambda trials: _delay(trials("better")) > _delay(trials("worse")), False),
        # A control that the agent cannot pass: it would have to be better than itself.
        (lambda trials: _stays(trials) & (trials("better").mean_success > trials("worse").mean_success), False),
        (lambda trials: trials("better").mean_success.equivalent_to(trials("worse").mean_success, margin=0.1), True),
        # It has no number of that name, or cannot stand for the task.
        (lambda trials: trials("better").reward > -5, "there is no 'last_fitness'"),
        (lambda trials: _stays(trials, "large"), "it cannot stand for the conditions"),
        # It can stand for the claimed side alone.
        (lambda trials: trials("better").mean_success > trials("worse", "large").mean_success, True),
    ],
)
def test_an_agent_satisfies_what_asks_for_nothing_learnt(put: Put, asserted: Any, answer: bool | str) -> None:
    report = put(asserted)
    assert report.satisfied_by == (("still",) if answer is True else ())
    assert report.unasked == ((("still", answer),) if isinstance(answer, str) else ())


def test_an_agent_everywhere_is_never_put_beside_trials(put: Put) -> None:
    agent = NullAgent("solves nothing", _still, everywhere=True)
    assert (
        put(lambda trials: trials("better").mean_success > trials("worse").mean_success, full=agent).satisfied_by == ()
    )
    assert put(_stays, full=agent).satisfied_by == ("full",)


def test_controls_are_put_to_no_agent(put: Put) -> None:
    report = put(_stays, where=CONTROL)
    assert report.satisfied_by == report.unasked == ()


@pytest.mark.parametrize(("variant", "satisfied"), [("", ("still",)), ("longer", ())])
def test_under_a_variant_a_refuted_claim_is_put_to_no_agent(put: Put, variant: str, satisfied: tuple[str, ...]) -> None:
    """Of a variant's verdicts only vacuous ones are shown, and asking takes a third of the time of all tables."""
    report = put(lambda trials: trials("better").mean_success.between(0.35, 0.45), variant=variant)
    assert (report.outcome, report.satisfied_by) == (Outcome.REFUTED, satisfied)
    report = put(lambda trials: trials("better").mean_success > trials("worse").mean_success, variant=variant)
    assert (report.outcome, report.satisfied_by) == (Outcome.SUPPORTED, ("still",))


def test_an_agent_that_is_a_method_is_not_run_for_it(put: Put) -> None:
    report = put(_stays, chance=NullAgent("the worse one", method="worse"))
    assert (report.satisfied_by, report.unasked) == ((), (("chance", "only stored trials are asked for"),))
    assert "unasked" not in report.to_json()  # records of verdicts stay as they are


ELSEWHERE = "it is run on another instance of the task"


@pytest.mark.parametrize(
    ("on", "meets", "answer"),
    [("small", _as_it_is, True), ("small", type, True), ("large", _as_it_is, ELSEWHERE), ("large", type, True)],
)
def test_an_agent_that_is_a_method_stands_only_for_the_task_that_it_meets(
    reproduction: Reproduction, store: Store, served: Any, on: str, meets: Callable[[Any], Any], answer: Any
) -> None:
    """A method may have another instance under the same name, with other rewards, say."""
    session = Session(reproduction, store, served(_value))
    design, agents = session.design("full"), {"chance": NullAgent("the worse one", method="worse", meets=meets)}
    says = session.group("better", "small", "full").does_not_solve_the_last_level.stays()
    found = answers(
        agents, says, design.last, design, session.trials_of, lambda method, task: session.group(method, on, "full")
    )
    assert found == {"chance": answer}


@pytest.mark.parametrize("fields", [{}, {"method": "worse", "numbers": _still}])
def test_an_agent_has_numbers_or_a_method(fields: Any) -> None:
    with pytest.raises(UserError, match=r"The null agent 'x' has (both|neither) numbers .* a method\. Write either"):
        NullAgent("x", **fields)
