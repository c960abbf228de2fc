"""Mutants: named faults, and the conditions with them at a tier."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from evoclaims.core.errors import UserError
from evoclaims.envs.gates.circuit import Circuit
from evoclaims.methods.cma_es import CmaEs
from evoclaims.methods.map_elites import MapElites
from evoclaims.methods.mechanisms.observed import Observed
from evoclaims.mutants import faults
from evoclaims.mutants.faults import Fault, plant
from evoclaims.paper.config import import_module
from evoclaims.paper.reproduction import Conditions, Names, Reproduction
from evoclaims.trials.spec import Condition
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.mutation_matrix import Part


@dataclass(frozen=True)
class Mutant:
    """A fault that can be planted in the methods, or the tasks, of conditions.

    Attributes:
        says: what is wrong, such as "minimizes".
        part: "method" or "task", whichever has the fault.
        change: returns a condition with the fault, or None where it cannot be planted.
    """

    says: str
    part: Part
    change: Callable[[Condition], Condition | None]

    def conditions(self, sound: Conditions, target: str) -> dict[Names, Condition]:
        """Return the faulty conditions of one method, or one task, by the names under which claims ask for them."""
        place = 0 if self.part == "method" else 1
        run_here = {names: one for names, one in sound.items() if names[place] == target and not one.existing}
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
    return replace(mutant, change=lambda one: None if one.loop else mutant.change(one))


def _staying(one: Condition) -> Condition | None:
    """Training and examinations that stay at the first level of several."""
    if one.task.levels == 1:
        return None
    faulty: Any = plant(faults.StaysAtFirstLevel, one.task)
    return replace(one, task=faulty)


MUTANTS: Final[Mapping[str, Mutant]] = {
    "learns-nothing": of_method(faults.LearnsNothing),
    "minimizes": of_method(faults.Minimizes),
    "selects-at-random": of_method(faults.SelectsAtRandom),
    "forgets-champion": of_method(faults.ForgetsChampion),
    "fixed-step-size": of_method(faults.KeepsItsStepSize, CmaEs),
    "random-archive": with_method("varies no elite", lambda method: replace(method, initial=2**30), MapElites),
    "blind": of_task(faults.Blind),
    "paralysed": of_task(faults.Paralysed),
    "pays-nothing": of_task(faults.PaysNothing),
    "reverses-rewards": of_task(faults.ReversesReward),
    "pays-at-random": of_task(faults.PaysAtRandom),
    "first-level-only": _where_compiled(Mutant(faults.StaysAtFirstLevel.says, "task", _staying)),
    "ignores-an-input": of_task(faults.IgnoresAnInput, Circuit),
    "wrong-row": of_task(faults.HasAWrongRow, Circuit),
}
"""Faults that any paper's methods and tasks may have; a reproduction may declare further ones."""


def load(reproduction: Reproduction) -> Mapping[str, Mutant]:
    """Return all mutants by name, the reproduction's own last.

    Raises:
        UserError: when the module of its own does not import, holds no mutants, or one of another's name.
    """
    if not reproduction.mutants:
        return MUTANTS
    module = import_module(reproduction.mutants, reproduction.folder, f"the reproduction {reproduction.name!r}")
    own = getattr(module, "MUTANTS", None)
    if not isinstance(own, Mapping) or not all(isinstance(one, Mutant) for one in own.values()):
        raise UserError(f"The module {reproduction.mutants!r} has no MUTANTS = {{name: Mutant(...), ...}}.")
    taken = sorted(own.keys() & MUTANTS.keys())
    if taken:
        raise UserError(f"The module {reproduction.mutants!r} has a mutant called {taken[0]!r}, as every paper has.")
    return {**MUTANTS, **own}


@dataclass(frozen=True)
class Planted:
    """A fault in one method, or one task, of a tier, with the faulty conditions."""

    mutant: str
    part: Part
    target: str
    conditions: Conditions

    @property
    def name(self) -> str:
        """A name such as "cma_es: minimizes"."""
        return f"{self.target}: {self.mutant}"

    def touching(self, report: ClaimReport) -> tuple[Names, ...]:
        """Return the faulty conditions that a claim is about, by the names under which it asks for them."""
        asked = {(source.method, source.task) for source in report.sources}
        return tuple(names for names in self.conditions if names in asked)


def plantings(sound: Conditions, mutants: Mapping[str, Mutant]) -> tuple[Planted, ...]:
    """Return every fault in every method or task that it can be planted in."""
    return tuple(
        Planted(name, mutant.part, target, mutant.conditions(sound, target))
        for name, mutant in mutants.items()
        for target in mutant.targets(sound)
    )
