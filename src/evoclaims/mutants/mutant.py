"""Mutants: named faults, and the conditions with them at a tier."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

from evoclaims.envs.gates.circuit import Circuit
from evoclaims.methods.cma_es import CmaEs
from evoclaims.methods.map_elites import MapElites
from evoclaims.mutants import of_methods, of_tasks
from evoclaims.mutants.planting import Fault, plant
from evoclaims.paper.variant import Conditions
from evoclaims.trials.spec import Condition

Part = Literal["method", "task"]


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

    def conditions(self, sound: Conditions, target: str) -> dict[tuple[str, str], Condition]:
        """Return the faulty conditions of one method, or one task, by the names under which claims ask for them."""
        place = 0 if self.part == "method" else 1
        changed = {names: self.change(one) for names, one in sound.items() if names[place] == target}
        return {names: faulty for names, faulty in changed.items() if faulty is not None}

    def targets(self, sound: Conditions) -> tuple[str, ...]:
        """Return the methods, or tasks, that the fault can be planted in, in their order."""
        place = 0 if self.part == "method" else 1
        names = dict.fromkeys(names[place] for names in sound)
        return tuple(name for name in names if self.conditions(sound, name))


def of_method(fault: type[Fault], only: type = object) -> Mutant:
    """Return the mutant that plants a fault in any method of a class."""
    return Mutant(
        fault.says,
        "method",
        lambda one: replace(one, method=_planted(fault, one.method)) if isinstance(one.method, only) else None,
    )


def of_task(fault: type[Fault], only: type = object) -> Mutant:
    """Return the mutant that plants a fault in any task of a class."""
    return Mutant(
        fault.says,
        "task",
        lambda one: replace(one, task=_planted(fault, one.task)) if isinstance(one.task, only) else None,
    )


def _planted(fault: type[Fault], component: Any) -> Any:
    """Plant a fault; types cannot say that the result is a method or task again."""
    return plant(fault, component)


def _drawing_all(one: Condition) -> Condition | None:
    """MAP-Elites that draws every individual anew, and never varies an elite."""
    method: Any = one.method
    return replace(one, method=replace(method, initial=2**30)) if isinstance(method, MapElites) else None


MUTANTS: Final[Mapping[str, Mutant]] = {
    "learns-nothing": of_method(of_methods.LearnsNothing),
    "minimizes": of_method(of_methods.Minimizes),
    "selects-at-random": of_method(of_methods.SelectsAtRandom),
    "forgets-champion": of_method(of_methods.ForgetsChampion),
    "one-seed": of_method(of_methods.HasOneSeed),
    "fixed-step-size": of_method(of_methods.KeepsItsStepSize, CmaEs),
    "random-archive": Mutant("varies no elite", "method", _drawing_all),
    "blind": of_task(of_tasks.Blind),
    "paralysed": of_task(of_tasks.Paralysed),
    "pays-nothing": of_task(of_tasks.PaysNothing),
    "reverses-rewards": of_task(of_tasks.ReversesReward),
    "pays-at-random": of_task(of_tasks.PaysAtRandom),
    "first-level-only": of_task(of_tasks.StaysAtFirstLevel),
    "ignores-an-input": of_task(of_tasks.IgnoresAnInput, Circuit),
    "wrong-row": of_task(of_tasks.HasAWrongRow, Circuit),
}
"""Faults that any paper's methods and tasks may have; a reproduction may declare further ones."""
