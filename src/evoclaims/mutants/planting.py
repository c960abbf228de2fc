"""Planting a fault in a method or a task: the same parameters, with one of its functions replaced."""

from __future__ import annotations

from functools import cache
from typing import Any, ClassVar, TypeVar

from evoclaims.core.errors import UserError

F = TypeVar("F", bound="Fault")


class Fault:
    """What a fault replaces; a subclass overrides functions of the method or task that it is planted in.

    A faulty component is also an instance of the sound one's class, since methods and reports check a task's class. Its
    name differs, so that it has its own trials, and code for sound components has no switch for faults.
    """

    says: ClassVar[str]
    _sound_class: ClassVar[type]

    @property
    def sound(self) -> Any:
        """The component without the fault."""
        made: Any = object.__new__(self._sound_class)
        made.__dict__.update(self.__dict__)
        return made

    @property
    def name(self) -> str:
        """The sound component's name, and what is wrong."""
        return f"{self.sound.name} that {self.says}"


@cache
def _faulty(fault: type[Fault], sound: type) -> type:
    """Return the class of a faulty component; cached, so that equal components have one class."""
    return type(f"{fault.__name__}{sound.__name__}", (fault, sound), {"_sound_class": sound})


def plant(fault: type[F], component: Any) -> F:
    """Return a component with the same parameters and the fault.

    Raises:
        UserError: when there is a fault in it already: a combination of two has no clear meaning.
    """
    if isinstance(component, Fault):
        raise UserError(f"{component.name!r} has a fault already. Plant each fault in a component without one.")
    kinds: Any = fault, type(component)
    made: F = object.__new__(_faulty(*kinds))
    made.__dict__.update(component.__dict__)
    return made
