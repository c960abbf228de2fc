"""Mutants: named faults, and the conditions with them at a tier."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from evoclaims.envs.gates.circuit import Circuit
from evoclaims.methods.cma_es import CmaEs
from evoclaims.methods.map_elites import MapElites
from evoclaims.methods.mechanisms.observed import Observed
from evoclaims.methods.training_loop import TrainingLoop
from evoclaims.mutants import of_methods, of_tasks
from evoclaims.mutants.planting import Fault, plant
from evoclaims.paper.variant import Conditions, Names
from evoclaims.trials.spec import Condition
from evoclaims.verdicts.mutation_matrix import Part


@dataclass(frozen=True)
class Mutant:
    """A fault that can be planted in the methods, or the tasks, of conditions.

    Attributes:
        says: what is wrong, such as "minimizes".
        part: what has the fault.
        change: returns a condition with the fault, or None where it cannot be planted.
    """

    says: str
    part: Part
    change: Callable[[Condition], Condition | None]

    def conditions(self, sound: Conditions, target: str) -> dict[Names, Condition]:
        """Return the faulty conditions of one method, or one task, by the names under which claims ask for them."""
        place = 0 if self.part == "method" else 1
        run_here = {names: one for names, one in sound.items() if names[place] == target and one.existing is None}
        changed = {names: self.change(one) for names, one in run_here.items()}
        return {names: one for names, one in changed.items() if one is not None and one.id != sound[names].id}

    def targets(self, sound: Conditions) -> tuple[str, ...]:
        """Return the methods, or tasks, that the fault can be planted in, in their order."""
        place = 0 if self.part == "method" else 1
        names = dict.fromkeys(names[place] for names in sound)
        return tuple(name for name in names if self.conditions(sound, name))


def of_method(fault: type[Fault], only: type | tuple[type, ...] = object) -> Mutant:
    """Return the mutant that plants a fault in any method of a class."""
    return _where_compiled(with_method(fault.says, lambda method: plant(fault, method), only))


def with_method(says: str, change: Callable[[Any], Any], only: type | tuple[type, ...] = object) -> Mutant:
    """Return the mutant that changes any method of a class, or the one that it observes."""

    def changed(one: Condition) -> Condition | None:
        method: Any = one.method
        of = method.of if isinstance(one.method, Observed) else method
        if not isinstance(of, only):
            return None
        return replace(one, method=change(of) if of is method else replace(method, of=change(of)))

    return Mutant(says, "method", changed)


def of_task(fault: type[Fault], only: type | tuple[type, ...] = object) -> Mutant:
    """Return the mutant that plants a fault in any task of a class."""
    return _where_compiled(with_task(fault.says, lambda task: plant(fault, task), only))


def with_task(says: str, change: Callable[[Any], Any], only: type | tuple[type, ...] = object) -> Mutant:
    """Return the mutant that changes any task of a class, such as one of its parameters."""
    return Mutant(says, "task", lambda one: replace(one, task=change(one.task)) if isinstance(one.task, only) else None)


def _where_compiled(mutant: Mutant) -> Mutant:
    """Skip training loops: they call none of our methods' functions and import tasks anew: no fault reaches them."""
    return replace(mutant, change=lambda one: None if isinstance(one.method, TrainingLoop) else mutant.change(one))


def _staying(one: Condition) -> Condition | None:
    """Training and examinations that stay at the first level of several."""
    if one.task.levels == 1:
        return None
    faulty: Any = plant(of_tasks.StaysAtFirstLevel, one.task)
    return replace(one, task=faulty)


MUTANTS: Final[Mapping[str, Mutant]] = {
    "learns-nothing": of_method(of_methods.LearnsNothing),
    "minimizes": of_method(of_methods.Minimizes),
    "selects-at-random": of_method(of_methods.SelectsAtRandom),
    "forgets-champion": of_method(of_methods.ForgetsChampion),
    "one-seed": of_method(of_methods.HasOneSeed),
    "fixed-step-size": of_method(of_methods.KeepsItsStepSize, CmaEs),
    "random-archive": with_method("varies no elite", lambda method: replace(method, initial=2**30), MapElites),
    "blind": of_task(of_tasks.Blind),
    "paralysed": of_task(of_tasks.Paralysed),
    "pays-nothing": of_task(of_tasks.PaysNothing),
    "reverses-rewards": of_task(of_tasks.ReversesReward),
    "pays-at-random": of_task(of_tasks.PaysAtRandom),
    "first-level-only": _where_compiled(Mutant(of_tasks.StaysAtFirstLevel.says, "task", _staying)),
    "ignores-an-input": of_task(of_tasks.IgnoresAnInput, Circuit),
    "wrong-row": of_task(of_tasks.HasAWrongRow, Circuit),
}
"""Faults that any paper's methods and tasks may have; a reproduction may declare further ones."""
