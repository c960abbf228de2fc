"""What a user's policy returns, as an action of another library's environment, or an error that names both.

This needs no jax: a training loop that does not use it starts in a third of the time.
"""

from __future__ import annotations

import math
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evoclaims.core.errors import UserError


def choice(action: Any, lowest: int, count: int, task: str) -> int:
    """Return a choice among `count` actions, the whole numbers from `lowest` on.

    Libraries return it as a number of Python, NumPy or PyTorch, or in an array of one element.

    Raises:
        UserError: for anything but one whole number in this range.
    """
    number = _only_number(action)
    if number is None or not math.isfinite(number) or number != int(number) or not 0 <= int(number) - lowest < count:
        raise UserError(
            f"The policy returned {_shown(action)} on {task}, where an action is a whole number from {lowest} to "
            f"{lowest + count - 1}. Return such a number, alone or in an array of one element."
        )
    return int(number)


def native_action(space: Any, action: Any, task: str) -> Any:
    """Return an action of one of Gymnasium's spaces.

    An array of the right shape stays as it is, whatever the type of its numbers; with NaN in it the environment's
    rewards are NaN, and the trial has diverged. Spaces that consist of others take what the policy returns.

    Raises:
        UserError: for an invalid choice, and for an array of another size or not of numbers.
    """
    if hasattr(space, "n") and space.shape == ():
        return choice(action, int(getattr(space, "start", 0)), int(space.n), task)
    if not isinstance(space.shape, tuple) or space.dtype is None or space.dtype.kind not in "biuf":
        return action
    array = _numbers(action, space.shape)
    if array is not None and space.dtype.kind != "f":  # several choices
        numbers = array
        array = np.nan_to_num(numbers).astype(space.dtype)
        array = array if bool((array == numbers).all()) and array in space else None
    if array is None:
        raise _misfit(action, f"{space.shape} in {space}", task)
    return array


def array_action(shape: tuple[int, ...], action: Any, task: str) -> NDArray[Any]:
    """Return an action that is an array of this shape; jax would broadcast another one.

    Raises:
        UserError: for an array of another size or not of numbers.
    """
    array = _numbers(action, shape)
    if array is None:
        raise _misfit(action, str(shape), task)
    return array


def _numbers(action: Any, shape: tuple[int, ...]) -> NDArray[Any] | None:
    """Return an action's numbers in a shape, the action itself where it has it; None where it has not as many."""
    try:
        array = np.asarray(action)
    except (TypeError, ValueError, RuntimeError):  # no numbers; or a tensor that is part of a graph
        return None
    if array.size != math.prod(shape) or array.dtype.kind not in "biuf":
        return None
    return array if array.shape == shape else array.reshape(shape)


def _misfit(action: Any, where: str, task: str) -> UserError:
    return UserError(
        f"The policy returned {_shown(action)} on {task}, where an action is an array of shape {where}. Return such an "
        "array of numbers."
    )


def _only_number(action: Any) -> float | None:
    """Return the number that is alone, or the only one of an array or a list; None for anything else."""
    try:
        number = action.item() if hasattr(action, "item") else np.asarray(action).item()
    except (TypeError, ValueError, RuntimeError):  # as each library refuses an array of several
        return None
    return float(number) if isinstance(number, Real) else None


def _shown(action: Any) -> str:
    """Return what a policy returned in one line, shortened."""
    text = " ".join(repr(action).split())
    return text if len(text) <= 80 else f"{text[:77]}..."
