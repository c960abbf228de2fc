"""Whatever form a policy's choice comes back in, it is the same action; anything else is a sentence."""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip("gymnasium", reason="Gymnasium is not installed")

import jax.numpy as jnp
import numpy as np
from gymnasium import spaces

from evoclaims.core.errors import UserError
from evoclaims.envs.foreign.gymnasium_task import GymnasiumTask
from evoclaims.envs.foreign.native_actions import choice, native_action

FORMS = {
    "number": lambda number: number,
    "float": float,
    "boolean": lambda number: bool(number) if number < 2 else number,
    "NumPy's integer": np.int64,
    "NumPy's float": np.float32,
    "0-d": np.array,
    "0-d float": lambda number: np.array(number, np.float32),
    "one element": lambda number: np.array([number]),
    "one element of a matrix": lambda number: np.array([[number]], np.uint8),
    "list": lambda number: [number],
    "jax": jnp.asarray,
}


@pytest.mark.parametrize("name", ["FrozenLake-v1", "CliffWalking-v1", "Blackjack-v1", "CartPole-v1"])
def test_choice_in_any_form_plays_the_same_episodes(name: str) -> None:
    """FrozenLake looks the action up in a table, CartPole asks its space, Blackjack compares it."""
    task = GymnasiumTask(name, episode_steps=6, examined_episodes=2)
    actions = task.action_size

    def play(form: Any) -> Any:
        steps = iter(range(100))
        return task.examine_natively(lambda observation: form(next(steps) % actions), 1)

    plain = play(int)
    for form in FORMS.values():
        assert play(form) == plain


@pytest.mark.parametrize(
    "wrong", [1.5, float("nan"), float("inf"), -1, 3, "1", None, [0, 1], np.zeros(0), np.zeros((2, 1)), 1j, {}, b"1"]
)
def test_anything_but_a_choice_is_refused(wrong: object) -> None:
    with pytest.raises(UserError, match="on lake, where an action is a whole number from 0 to 2"):
        choice(wrong, 0, 3, "lake")


def test_choices_begin_where_their_space_does() -> None:
    space = spaces.Discrete(3, start=-1)
    assert [native_action(space, np.array([number]), "t") for number in (-1, 1)] == [-1, 1]
    with pytest.raises(UserError, match="a whole number from -1 to 1"):
        native_action(space, 2, "t")


def test_several_choices_are_whole_numbers_in_their_space() -> None:
    several, bits = spaces.MultiDiscrete([3, 2]), spaces.MultiBinary(3)
    for action in ([2, 1], np.array([2.0, 1.0]), np.array([[2], [1]])):
        assert native_action(several, action, "t") in several
    assert native_action(bits, [1.0, 0.0, 1.0], "t").tolist() == [1, 0, 1]
    for wrong in ([2.5, 1], [3, 1], [-1, 0], [2], "ab"):
        with pytest.raises(UserError, match="where an action is an array of shape"):
            native_action(several, wrong, "t")


def test_array_of_the_right_shape_stays_as_it_is() -> None:
    box = spaces.Box(-1.0, 1.0, (2,), np.float32)
    action = np.array([0.1, 7.0])  # of another type, and out of bounds: the environment's own affair
    assert native_action(box, action, "t") is action
    assert native_action(box, [0.1, 0.2], "t").shape == (2,)
    assert native_action(box, np.zeros((1, 2)), "t").shape == (2,)
    broken = np.array([np.nan, 0.0])  # the trial has diverged
    assert native_action(box, broken, "t") is broken
    for wrong in (np.zeros(3), 0.5, None, "ab"):
        with pytest.raises(UserError, match=r"on t, where an action is an array of shape \(2,\)"):
            native_action(box, wrong, "t")


def test_spaces_of_several_others_take_what_the_policy_returns() -> None:
    action = {"a": 1, "b": object()}
    assert native_action(spaces.Dict(a=spaces.Discrete(2), b=spaces.Text(3)), action, "t") is action
    assert native_action(spaces.Text(3), "abc", "t") == "abc"
