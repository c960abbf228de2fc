"""The specification of a trial: method, task, progression, budget and seed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from inspect import getattr_static
from numbers import Real
from typing import Any, Final, Literal, get_args

from evoclaims.core.canonical import as_plain, content_hash, fields_of, is_own, require_numbers
from evoclaims.core.errors import UserError, require_known
from evoclaims.core.packages import ALWAYS, installed, packages_of
from evoclaims.core.source_code import CODE, REGISTRATION, code_of, is_edited
from evoclaims.envs.base import Task
from evoclaims.methods.base import Method, SeldomTested
from evoclaims.methods.training_loop import TrainingLoop
from evoclaims.trials.budget import Budget
from evoclaims.trials.result import TrialResult

Progression = Literal["curriculum", "direct", "whole_budget"]

ENGINE_REVISION = 1
"""Raised when the engine changes what a trial computes, so that old records are not taken for new ones."""


_NEEDS: Final = {
    "method": (("init", "step", "best", "cost"), ()),
    "task": (("reset", "step", "episode", "examine"), ("levels", "observation_size", "action_size", "horizon")),
}
"""The functions and the numbers that a method and a task have (see `Method` and `Task`)."""


def _described(component: Any, kind_of: Literal["method", "task", ""]) -> dict[str, Any]:
    """Return name, revision and parameters of a component, as plain JSON; a `UserError` says what is missing.

    As a method or a task it needs what these have; a training loop's task, which no engine plays, needs neither.
    """
    if isinstance(component, type):
        raise UserError(
            f"{component.__name__} is a class, and an object of it is needed. Write {component.__name__}()."
        )
    kind = type(component).__name__
    for name, of in (("name", str), ("revision", int)):
        given = getattr(component, name, None)
        if type(given) is not of:
            has = "has no" if given is None else f"has {given!r} as its"
            raise UserError(
                f"{kind} {has} {name}, which is part of its trials' ids. Write `{name}: "
                f"ClassVar[{of.__name__}] = …` in it."
            )
    frozen = getattr(getattr(type(component), "__dataclass_params__", None), "frozen", None)
    if not frozen:
        raise UserError(
            f"{kind} is not a {'dataclass' if frozen is None else 'frozen dataclass'}. Write "
            "@dataclass(frozen=True) above the class: the fields of a method or task identify its trials."
        )
    functions, numbers = _NEEDS.get(kind_of, ((), ()))
    lacking = [name for name in functions if not callable(getattr(component, name, None))]
    if lacking:
        raise UserError(
            f"{kind} has no function {' and no '.join(lacking)}. Write `def {lacking[0]}(self, …)` in it. "
            f"A {kind_of} has {', '.join(functions)}."
        )
    unsaid = [name for name in numbers if getattr_static(component, name, None) is None]  # to read one may take long
    if unsaid:
        raise UserError(
            f"{kind} has no {' and no '.join(unsaid)}. Write `{unsaid[0]}: ClassVar[int] = …` in it, or a "
            f"field or property of that name. A {kind_of} needs {', '.join(numbers)}."
        )
    require_numbers(component)
    inherited = not is_own(type(component)) and not _has_own_name(component)
    named = {"class": kind} if inherited else {}  # it computes something else than the class whose name it has
    try:
        parameters = fields_of(component)
    except TypeError as error:
        raise UserError(
            f"A field of {kind} is not a number, word, tuple or frozen dataclass, so it cannot identify "
            f"trials: {error}."
        ) from error
    return {"name": component.name, "revision": component.revision, "parameters": parameters, **named}


def _has_own_name(component: Any) -> bool:
    """Whether a class that is not of this package says the name, in itself, a base or a field."""
    of_others = (base for base in type(component).__mro__ if not is_own(base))
    return any("name" in (*vars(base), *getattr(base, "__annotations__", ())) for base in of_others)


@dataclass(frozen=True)
class Condition:
    """Everything that a group of trials shares; they differ only in the seed.

    Attributes:
        method: the algorithm with its frozen hyperparameters.
        task: the task with its frozen parameters.
        progression: "curriculum" starts at level 0 and moves up; "direct" stays on the last level; both end when that
            is solved. "whole_budget" stays on the last level to the end of the budget, even if solved.
        budget: training length and reports.
    """

    method: Method[Any]
    task: Task
    progression: Progression
    budget: Budget

    def __post_init__(self) -> None:
        """Reject an unknown progression, and look at the code before anybody edits it during a run."""
        require_known("progression", self.progression, get_args(Progression))
        _ = self.code

    @cached_property
    def plain(self) -> dict[str, Any]:
        """The condition as plain JSON: what its id hashes."""
        return {
            "engine": ENGINE_REVISION,
            "method": _described(self.method, "method"),
            "task": _described(self.task, "" if self.loop else "task"),
            "progression": self.progression,
            "budget": as_plain(self.budget),
        }

    @cached_property
    def id(self) -> str:
        """SHA-256 of the canonical JSON of the condition, revisions included."""
        return content_hash(self.plain)

    @cached_property
    def trial_ids(self) -> dict[int, str]:
        """Ids of the condition's trials by seed, as far as they were asked for: hashing takes a millisecond each."""
        return {}

    @cached_property
    def packages(self) -> tuple[str, ...]:
        """The packages that compute the trials: those of every trial, and those that method and task declare.

        They are not part of the id: a trial may have several records, one per set of their versions.
        """
        return tuple(sorted({*ALWAYS, *packages_of(self.method), *packages_of(self.task)}))

    @property
    def versions(self) -> dict[str, str | None]:
        """The versions of `packages` in this environment: trials stored with others do not count for it."""
        return installed(self.packages)

    @cached_property
    def code(self) -> dict[str, str]:
        """Hashes of the project's own code of the method and the task, by class; they are not part of the id."""
        return code_of(self.method, self.task)

    def edited_since(self, trials: Iterable[TrialResult]) -> tuple[str, ...]:
        """Return the project's classes whose code some of these trials ran otherwise, or under another name."""
        recorded = [code for trial in trials if isinstance(code := trial.provenance.get(CODE), Mapping)]

        def was_edited(name: str, now: str) -> bool:
            """Older records have no registrations."""
            known = [code for code in recorded if name in code or not name.startswith(REGISTRATION)]
            return any(is_edited(code.get(name), now) for code in known)

        return tuple(name for name, now in self.code.items() if was_edited(name, now))

    @property
    def programs(self) -> str:
        """What conditions have in common that probably share compiled programs: all but the numbers of the task."""
        task = self.task
        kind = type(task).__qualname__, task.action_size, task.levels, task.horizon
        return str((self.plain["method"], self.progression, self.budget, kind))

    @property
    def loop(self) -> TrainingLoop | None:
        """The training loop that makes the trials; None where the engine compiles method and task."""
        return self.method if isinstance(self.method, TrainingLoop) else None

    @property
    def existing(self) -> tuple[TrialResult, ...]:
        """All trials that there can be, by seed from 0, where no more can be run; none for what the harness runs."""
        return ()

    @property
    def table_rows(self) -> frozenset[tuple[str, int]]:
        """The rows of a table, by its hash, that the trials are read from; none for what the harness runs."""
        return frozenset()

    @property
    def label(self) -> str:
        """A short name for progress lines and tables, such as "cma_es on n_parity"."""
        return f"{self.method.name} on {self.task.name}" + " (direct)" * (self.progression == "direct")

    @property
    def cost(self) -> int:
        """Environment steps that a step of the method spends.

        Raises:
            UserError: when the method gives no whole number from 1 up.
        """
        cost = self.method.cost(self.task)
        if not (isinstance(cost, Real) and cost >= 1 and cost % 1 == 0):
            if (horizon := self.task.horizon) == 0:  # of which most methods' costs are multiples
                raise UserError(f"{self.task.name!r} has horizon = {horizon}. It must be at least 1 step.")
            raise UserError(
                f"A step of {self.method.name!r} on {self.task.name!r} costs {cost!r} environment steps "
                "by its `cost`. It must return a whole number, at least 1."
            )
        return cost

    @property
    def steps(self) -> int:
        """Steps of the method in the whole budget.

        Raises:
            UserError: when there are more than counters hold: 32-bit integers on devices, and floats in records; or
                fewer than the method makes before it tests whether it may move up a level.
        """
        steps = self.budget.steps(self.cost)
        if steps >= 2**31 and self.loop is None:
            raise UserError(
                f"{self.label} has a budget of {steps} steps, and a trial takes at most {2**31 - 1}. Make "
                "the budget smaller."
            )
        if steps * self.cost > 2**53:
            raise UserError(
                f"{self.label} has a budget of {steps * self.cost} environment steps ({steps} steps of "
                f"{self.cost}), and a trial takes at most 2^53 = {2**53}. Make the budget or the cost of "
                "a step smaller."
            )
        every = self.method.tested_every if isinstance(self.method, SeldomTested) else 1
        if self.progression == "curriculum" and self.task.levels > 1 and not 0 < every <= steps:
            raise UserError(
                f"{self.label} is a curriculum of {steps} steps, and {self.method.name} tests "
                f"{f'after each {every} whether it moves up' if every else 'nothing'}: it would stay at the first "
                "level. Let it test more often, or choose another progression."
            )
        return steps

    @property
    def environment_steps(self) -> int:
        """Environment steps of one trial that spends the whole budget."""
        return self.steps * self.cost

    @property
    def report_distance(self) -> int:
        """Most environment steps between two reports of a trial; 0 where each step of the method is reported."""
        chunk = self.budget.chunk(self.cost)
        return chunk * self.cost if chunk > 1 else 0

    @property
    def report_steps(self) -> tuple[float, ...]:
        """The environment steps of reports, where trials exist and all report at the same ones up to their ends."""
        return ()


@dataclass(frozen=True)
class TrialSpec:
    """One trial: a condition and a seed (from 0 to 2³¹ − 1, a 32-bit integer on the device)."""

    condition: Condition
    seed: int

    def __post_init__(self) -> None:
        """Reject seeds that the device's 32-bit integers cannot hold."""
        if not 0 <= self.seed < 2**31:
            raise UserError(f"A seed is a whole number from 0 to {2**31 - 1}, not {self.seed}.")

    @cached_property
    def plain(self) -> dict[str, Any]:
        """The specification as plain JSON: what its id hashes."""
        return {**self.condition.plain, "seed": self.seed}

    @cached_property
    def id(self) -> str:
        """SHA-256 of the canonical JSON of the specification."""
        known = self.condition.trial_ids
        if self.seed not in known:
            known[self.seed] = content_hash(self.plain)
        return known[self.seed]
