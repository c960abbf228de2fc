"""What is no array, policy or episode where one belongs is named, not what fails at it somewhere else."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import jax.numpy as jnp
import pytest
from trial_toys import Walker

from evoclaims.core.errors import UserError
from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.base import Policy
from evoclaims.methods.random_search import RandomSearch
from evoclaims.trials.compatibility import traced_progress

TASK = NParity(3)
BOTH = "The method 'walker' does not fit the task 'n_parity': "


@pytest.mark.parametrize(
    ("policy", "what"),
    [
        (Policy(jnp.zeros(1), None), "a Policy with None as its function, which cannot be called."),  # type: ignore[arg-type]
        (Policy(1.5, lambda _, bits: bits[:1]), "a Policy with 1.5 among its parameters, which are arrays: jnp."),
        (None, "None (without a `return`?), not Policy(parameters, function)."),
        (jnp.zeros(1), "an array, not Policy(parameters, function)."),
        ((jnp.zeros(1), jnp.tanh), "a tuple, not Policy(parameters, function)."),
    ],
    ids=["function", "float", "None", "array", "tuple"],
)
def test_a_policy_without_function_or_arrays_is_refused(policy: Any, what: str) -> None:
    method = type("Odd", (Walker,), {"best": lambda self, task, state: policy})()
    with pytest.raises(UserError) as caught:
        traced_progress(method, TASK)
    assert str(caught.value).startswith(f"{BOTH}'best' of 'walker' returns {what}")


@pytest.mark.parametrize("action", [None, "yes", [[1.0], [1.0, 2.0]]])
def test_an_action_that_is_no_array_is_refused_with_both_names(action: Any) -> None:
    method = type("Odd", (Walker,), {"best": lambda self, task, state: Policy(state, lambda p, bits: action)})()
    with pytest.raises(
        UserError, match=BOTH + r"an action is .*, which is not an array, and 'n_parity' takes shape \(1,\)"
    ):
        traced_progress(method, TASK)


@dataclass(frozen=True)
class Playing(NParity):
    """3-parity whose episode gives something else."""

    give: Any = None

    def episode(self, policy: Any, key: Any, level: Any) -> Any:
        return self.give(super().episode(policy, key, level))


@pytest.mark.parametrize(
    ("give", "what"),
    [
        (lambda e: None, "None (without a `return`?), not an Episode."),
        (lambda e: e.fitness, "an array, not an Episode."),
        (lambda e: (e.fitness, e.success), "a tuple, not an Episode."),
        (lambda e: replace(e, success=[e.success]), "a success of a list, which is not an array, not of shape () and"),
    ],
    ids=["None", "array", "tuple", "list"],
)
def test_an_episode_that_is_none_is_named_and_not_what_a_method_fails_at(give: Any, what: str) -> None:
    both = "The method 'random_search' does not fit the task 'n_parity': "
    with pytest.raises(UserError) as caught:
        traced_progress(RandomSearch(2), Playing(3, give=give))
    assert str(caught.value).startswith(f"{both}an episode of 'n_parity' gives {what}")


def test_an_error_of_the_methods_own_is_not_laid_at_the_episodes_door() -> None:
    method = type("Odd", (Walker,), {"step": lambda *_: TASK.nothing})()
    with pytest.raises(AttributeError, match="nothing"):
        traced_progress(method, TASK)
