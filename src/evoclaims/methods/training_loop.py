"""A training loop that is not ours, such as that of Stable-Baselines3, where a method stands."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, NoReturn

from evoclaims.core.errors import UserError
from evoclaims.core.portable import reference

_NOT_HASHED: Final[Mapping[str, Any]] = {"canonical": False}


@dataclass(frozen=True)
class TrainingLoop:
    """A function that trains, run once for each trial, in a process of its own.

    It is called as `function(task, seed, budget, **settings)`, with `report=` too if it has a parameter of that name,
    and returns its metrics (a table of numbers by name) or `(metrics, policy)`. See docs/foreign.md.

    * `task` is the condition's: a built-in task, or another library's environment, which `task.make()` returns.
    * `seed` is the trial's; the function derives all randomness from it.
    * `budget` is the condition's `Budget`, such as `Budget(environment_steps=100_000)`.
    * `report(step, **numbers)` reports how far training is; the numbers become curves, about `budget.reports` points.
    * `policy` maps an observation to an action, deterministically. It is examined on the task as every method's is.
      Without one, the metrics are what the function says, and the trial's provenance says so.

    Attributes:
        function: the function, which a module defines, or its place, "module:name".
        settings: further arguments, by name: numbers, words, lists and tables; they are part of the trial's id.
        packages: the distributions that compute it, such as ("stable-baselines3", "torch"); another version runs its
            trials again.
        name: of the method; the function's if empty.
        revision: raise it when the function computes something else.
        deterministic: whether its trials have no chance in them, so that they may be copies of each other.
        overspend: the share by which a trial may exceed its budget, for loops that cannot stop in time. With 0.5, a
            trial that spends more than 1.5 times its budget makes its claim an error. Claims name every trial that
            exceeds it by more than 2%. If it is set, it is part of the trial's id.
    """

    function: Callable[..., Any] | str
    settings: Mapping[str, Any] = field(default_factory=dict, hash=False)
    packages: tuple[str, ...] = field(kw_only=True, metadata=_NOT_HASHED)
    name: str = field(default="", kw_only=True, metadata=_NOT_HASHED)
    revision: int = field(default=1, kw_only=True, metadata=_NOT_HASHED)
    deterministic: bool = field(default=False, kw_only=True, metadata=_NOT_HASHED)
    overspend: float = field(default=1.0, kw_only=True, metadata={"canonical": "if set"})

    def __post_init__(self) -> None:
        """Replace the function by its place, after checking that it takes the settings."""
        if not isinstance(self.settings, Mapping):
            raise UserError(f"settings={self.settings!r} of a training loop is not a table of arguments by name.")
        object.__setattr__(self, "settings", dict(self.settings))
        if isinstance(self.overspend, bool) or not (isinstance(self.overspend, int | float) and self.overspend >= 0):
            raise UserError(
                f"overspend={self.overspend!r} of a training loop is not a share of its budget, 0 or "
                "above. Write 0.5 if it may spend 1.5 times its budget."
            )
        object.__setattr__(self, "overspend", float(self.overspend))  # 1 and 1.0 are one id
        for name, value in self.settings.items():
            if not _is_plain(value):
                raise UserError(
                    f"The setting {name!r} of a training loop is {value!r}, which cannot be part of its trials' ids. "
                    "Write numbers, words, and lists or tables of these, and let the training function make the "
                    "rest."
                )
        if callable(self.function):
            place = reference(self.function)
            check_arguments(self.function, self.settings)
            object.__setattr__(self, "function", place)
        if not re.fullmatch(r"[\w.]+:[\w.]+", self.place):
            raise UserError(
                f"A training loop is a function, or its place such as 'our_loops:train', not {self.function!r}."
            )
        if not self.name:
            object.__setattr__(self, "name", self.place.rpartition(":")[2])

    @property
    def place(self) -> str:
        """Where the function is: "module:name"."""
        return str(self.function)

    def cost(self, task: object) -> int:
        """Return 1: a budget's environment steps are the function's own to count."""
        return 1

    def init(self, *_: Any, **__: Any) -> NoReturn:
        """Raise a `UserError`: the function trains, not steps that the engine compiles."""
        raise UserError(
            f"{self.name!r} is a training loop. Its policies are examined where they are trained and are not kept, "
            "so it has no champion. Use a method with init, step, best and cost here."
        )

    step = best = init


def _is_plain(value: Any) -> bool:
    """Whether the canonical JSON of a value identifies it."""
    if isinstance(value, dict):
        return all(isinstance(name, str) and _is_plain(item) for name, item in value.items())
    if isinstance(value, list | tuple):
        return all(map(_is_plain, value))
    return value is None or isinstance(value, str | int | float)


def wants_report(function: Callable[..., Any]) -> bool:
    """Whether a training function has a parameter `report`."""
    return "report" in inspect.signature(function).parameters


def check_arguments(function: Callable[..., Any], settings: Mapping[str, Any]) -> None:
    """Check that a training function takes what it is called with.

    Raises:
        UserError: when it does not.
    """
    optional = {"report": None} if wants_report(function) else {}
    try:
        inspect.signature(function).bind(None, 0, None, **{**settings, **optional})
    except TypeError as error:
        raise UserError(
            f"The training function {function.__qualname__} does not take (task, seed, budget) and the settings "
            f"{', '.join(settings) or 'none'}: {error}. Give it these parameters, or leave out the settings that it "
            "does not take."
        ) from error
