"""A paper's reproduction: which trials each tier runs, and how many of them decide."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from evoclaims.core.errors import UnknownNameError, UserError, require_known
from evoclaims.core.tiers import TIERS
from evoclaims.judging.design import Design
from evoclaims.judging.exact import MAX_TRIALS
from evoclaims.paper.references import path_of
from evoclaims.paper.reported import FILE, Published, load_published
from evoclaims.paper.trial_group import TrialGroup
from evoclaims.trials.imported import Imported
from evoclaims.trials.spec import Condition

Names = tuple[str, str]
"""A method and a task, as claims name them."""

Conditions = Mapping[Names, Condition]


@dataclass(frozen=True)
class Variant:
    """The same claims, judged from trials that differ in one detail.

    Attributes:
        says: the detail, in a sentence.
        conditions: by tier, the conditions that the detail changes; all others stay as they are.
    """

    says: str
    conditions: Mapping[str, Conditions]


def changed(conditions: Conditions, change: Callable[[str, str, Condition], Any]) -> dict[Names, Condition]:
    """Return the new conditions where `change(method, task, condition)` returns a different one.

    `change` returns a condition, or None where the detail does not matter.
    """
    found = {names: change(*names, condition) for names, condition in conditions.items()}
    return {names: new for names, new in found.items() if new is not None and new.id != conditions[names].id}


Numbers = Mapping[str, Mapping[str, Any]]
"""What a record has in each of its parts (metrics, levels, curves), by name."""


def _as_it_is(task: Any) -> Any:
    return task


@dataclass(frozen=True)
class NullAgent:
    """Something that has not learnt what claims are about, such as a robot that takes no action.

    An assertion that its trials satisfy is vacuous, unless a planted fault is known to change its verdict. It has
    numbers of its own, or the trials of a method.

    Attributes:
        says: what it is, in a few words.
        numbers: a function from a condition to the metrics, levels and curves of the agent's trials, or to None if the
            agent cannot stand for it.
        method: a method of the same tier whose committed trials on the same task are its trials.
        meets: returns a task without differences by which the agent's numbers mean the same. Tasks of one name may
            differ otherwise, by their rewards, say: then the agent does not stand for the condition.
        everywhere: True if it only stands for all conditions of an assertion at once; False if it also stands for the
            claimed ones alone, beside the trials of the others (see `claims.null_agents`).

    Raises:
        UserError: when it has both or neither.
    """

    says: str
    numbers: Callable[[Condition], Numbers | None] | None = None
    method: str = ""
    meets: Callable[[Any], Any] = _as_it_is
    everywhere: bool = False

    def __post_init__(self) -> None:
        """Check that it has trials of one kind."""
        if (self.numbers is None) == (not self.method):
            raise UserError(
                f"The null agent {self.says!r} has "
                f"{'both numbers and a method' if self.method else 'neither numbers nor a method'}. Write either "
                "numbers=... or method=...."
            )


class OtherTierError(UnknownNameError):
    """A condition that only other tiers have; an `UnknownNameError` whose message says which."""

    def __init__(self, tier: str, what: str, others: Iterable[str]) -> None:
        """Build the message from the `tier` without it, such as "full", `what` it lacks, and the `others`."""
        UserError.__init__(
            self, f"The {tier} tier has no {what} ({' and '.join(others)} has it): add a condition to the {tier} tier."
        )


@dataclass(frozen=True)
class Tier:
    """One size at which the paper's claims are run.

    Attributes:
        conditions: by method and task, as claims name them: `{("ppo", "n_parity"): Condition(...)}`.
        design: how many trials are judged, with which error rates.
        for_drift: by method and task, how many more trials a run of claims makes on CPUs, with the seeds after the
            design's. Only the drift check reads them. They run in the same batch, which compiles nothing for them: of a
            condition with cheap trials, they show a smaller shift for little time.
        repeat_drift: whether a run in which a method drifted makes three times as many trials of it with fresh seeds,
            on CPUs; a drift that these do not show fails no run.
        name: such as "smoke"; the reproduction gives it.
        others: what the reproduction's other tiers have, by name; the reproduction gives them, for errors.
    """

    conditions: Mapping[tuple[str, str], Condition]
    design: Design
    for_drift: Mapping[tuple[str, str], int] = field(default_factory=dict, kw_only=True)
    repeat_drift: bool = field(default=False, kw_only=True)
    name: str = field(default="", kw_only=True, compare=False, repr=False)
    others: Mapping[str, Collection[Names]] = field(default_factory=dict, kw_only=True, compare=False, repr=False)

    def __post_init__(self) -> None:
        """Reject what is no design, name or condition, and trials for drift that nothing could compare."""
        if not isinstance(self.design, Design):
            raise UserError(
                f"A tier has design={self.design!r}, which is not a Design. Write Tier(conditions, Design.fixed(10)) "
                "for ten trials."
            )
        for key, condition in self.conditions.items():
            if not isinstance(key, tuple) or len(key) != 2 or not all(isinstance(name, str) for name in key):
                raise UserError(
                    f"A tier has a condition named {key!r}. Name a method and a task, as in "
                    '{("hill_climber", "majority"): Condition(...)}.'
                )
            if not isinstance(condition, Condition | Imported):
                raise UserError(
                    f"A tier has {condition!r} for {' on '.join(key)}. Write a Condition(...), or Imported(...)."
                )
        for names, more in self.for_drift.items():
            self.condition(*names)
            if not 1 <= more <= MAX_TRIALS - self.design.last.n:
                raise UserError(
                    f"A tier has for_drift={more} more trials of {' on '.join(names)}. With the design's "
                    f"{self.design.last.n} they can be at most {MAX_TRIALS}, and at least one."
                )

    def seeds_for_drift(self, method: str, task: str) -> range:
        """Return the seeds of a condition's trials that only the drift check reads (see `for_drift`)."""
        first = self.design.first_seed + self.design.last.n
        return range(first, first + self.for_drift.get((method, task), 0))

    def condition(self, method: str, task: str) -> Condition:
        """Return the condition of a method on a task; an `UnknownNameError` lists the known ones, or tiers with it."""
        if (method, task) in self.conditions:
            return self.conditions[method, task]
        methods = {m for m, _ in self.conditions}
        if method not in methods:
            self._require_nowhere_else(f"method {method!r}", lambda names: names[0] == method)
        require_known("method", method, methods)
        tasks = {t for m, t in self.conditions if m == method}
        if task not in tasks:
            self._require_nowhere_else(f"task {task!r} for {method}", lambda names: names == (method, task))
        require_known(f"task for {method}", task, tasks)
        return self.conditions[method, task]

    def _require_nowhere_else(self, what: str, is_it: Callable[[Names], bool]) -> None:
        """Raise an `OtherTierError` if other tiers have what this one lacks."""
        others = [tier for tier, conditions in self.others.items() if any(map(is_it, conditions))]
        if others:
            raise OtherTierError(self.name, what, others)


@dataclass(frozen=True)
class Reproduction:
    """A paper under test.

    Attributes:
        name: a short name, such as "nisioti2025".
        title: the paper's title.
        folder: of the reproduction; its reference trials are in folder/reference, the paper's numbers in
            folder/reported.toml.
        tiers: by name; "smoke" and "full".
        variants: of the protocol, by name; claims are judged again under them.
        figures: modules that redraw the paper's figures and tables, in paper order; each holds FIGURE, an
            `evoclaims.figures.Figure` with the module's last name, and is imported only when it is drawn.
        trials: class that `trials(...)` returns: `TrialGroup`, or a subclass with the paper's own measures.
        mutants: module with the paper's own planted faults; it holds MUTANTS, `evoclaims.mutants.Mutant` by name, and
            is imported only when they are tried.
        null_agents: by name, what has learnt nothing (see `NullAgent`).

    Tables of imported trials are looked for in `folder`.

    Raises:
        UserError: when `trials` is not such a class, the folder is not a `pathlib.Path`, or conditions of different
            classes have one id, or two have one file of reference trials.
    """

    name: str
    title: str
    folder: Path
    tiers: Mapping[str, Tier]
    figures: tuple[str, ...] = ()
    variants: Mapping[str, Variant] = field(default_factory=dict)
    trials: type[TrialGroup] = TrialGroup
    mutants: str = ""
    null_agents: Mapping[str, NullAgent] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the folder and the class of the trials, and say where imported ones are."""
        if not isinstance(self.folder, Path):
            raise UserError(
                f"The reproduction {self.name!r} has folder={self.folder!r}. Write Path(__file__).parent, "
                "a pathlib.Path."
            )
        if not (isinstance(self.trials, type) and issubclass(self.trials, TrialGroup)):
            raise UserError(
                f"The reproduction {self.name!r} has trials={self.trials!r}. Name a subclass of TrialGroup whose "
                "properties are the paper's own measures, or leave it out."
            )
        has = {name: tuple(tier.conditions) for name, tier in self.tiers.items()}
        tiers = {
            name: replace(
                tier,
                conditions=self._found(tier.conditions),
                name=name,
                others={other: names for other, names in has.items() if other != name},
            )
            for name, tier in self.tiers.items()
        }
        object.__setattr__(self, "tiers", tiers)
        for name, one in self.variants.items():
            for tier in one.conditions:  # an unknown one would change nothing, in silence
                require_known(f"tier for the variant {name!r}", tier, {*TIERS, *self.tiers})
        variants = {
            name: replace(one, conditions={tier: self._found(these) for tier, these in one.conditions.items()})
            for name, one in self.variants.items()
        }
        object.__setattr__(self, "variants", variants)
        of_tiers = [tier.conditions for tier in tiers.values()]
        every = [*of_tiers, *(these for one in variants.values() for these in one.conditions.values())]
        _check_files(every)
        _check_classes(every)

    def _found(self, conditions: Conditions) -> dict[Names, Condition]:
        """Return conditions whose tables are looked for in the reproduction's folder."""
        return {
            names: replace(one, folder=self.folder) if isinstance(one, Imported) else one
            for names, one in conditions.items()
        }

    @property
    def imported(self) -> tuple[Condition, ...]:
        """The conditions whose trials another program has run, of all tiers and variants."""
        of_tiers = [tier.conditions for tier in self.tiers.values()]
        of_variants = [these for variant in self.variants.values() for these in variant.conditions.values()]
        found = (one for these in (*of_tiers, *of_variants) for one in these.values() if isinstance(one, Imported))
        return tuple({one.id: one for one in found}.values())

    def tier(self, name: str, variant: str = "") -> Tier:
        """Return a tier, changed by a variant if one is named; an `UnknownNameError` lists the known ones."""
        changes = self.changed_by(variant, name)
        if not changes:
            return self.tiers[name]
        if (name, variant) not in self._changed_tiers:  # tables of all variants ask for them thousands of times
            tier = self.tiers[name]
            self._changed_tiers[name, variant] = replace(tier, conditions={**tier.conditions, **changes})
        return self._changed_tiers[name, variant]

    @cached_property
    def _changed_tiers(self) -> dict[tuple[str, str], Tier]:
        """The tiers that `tier` has made for variants, by both names."""
        return {}

    @property
    def seeds_for_drift(self) -> dict[str, range]:
        """The seeds of trials that only the drift check reads, by the condition's id: of all tiers' (see `Tier`)."""
        found = {}
        for tier in self.tiers.values():
            for names in tier.for_drift:
                with suppress(UserError):  # it has no id: an error of the claims that ask for it
                    found[tier.condition(*names).id] = tier.seeds_for_drift(*names)
        return found

    def changed_by(self, variant: str, tier: str) -> Conditions:
        """Return what a variant changes at a tier, nothing without one; an `UnknownNameError` lists the known ones."""
        require_known("tier", tier, self.tiers)
        if not variant:
            return {}
        require_known("variant", variant, self.variants)
        return self.variants[variant].conditions.get(tier, {})

    @cached_property
    def published(self) -> Published:
        """The numbers that the paper has published; none without a file of them.

        Raises:
            UserError: when that file cannot be read.
        """
        path = self.folder / FILE
        return load_published(path) if path.exists() else Published({}, {})

    @property
    def references(self) -> Path:
        """The folder of committed reference trials, those of variants included."""
        return self.folder / "reference"

    def references_of(self, variant: str) -> Path:
        """The folder of the reference trials that only a variant has; without a name, of the protocol's."""
        return self.references / "variants" / variant if variant else self.references


def _check_files(several: Iterable[Conditions]) -> None:
    """Refuse two conditions with one file of reference trials: the second would be written over the first.

    Raises:
        UserError: naming both.
    """
    for conditions in several:
        known: dict[Path, Names] = {}
        for names in conditions:
            path = path_of(Path(), "", *names)
            first = known.setdefault(path, names)
            if first != names:
                raise UserError(
                    f"{' on '.join(first)} and {' on '.join(names)} would have one file of reference trials, {path}. "
                    "Write another name of a method or a task."
                )


def _check_classes(several: Iterable[Conditions]) -> None:
    """Refuse conditions that have one id although their classes differ: one would be judged by the other's trials.

    Raises:
        UserError: naming both.
    """
    known: dict[str, tuple[Names, Collection[str]]] = {}
    for names, one in ((names, one) for conditions in several for names, one in conditions.items()):
        if isinstance(one, Imported):
            continue
        try:
            first, code = known.setdefault(one.id, (names, one.code.keys()))
        except UserError:  # it has no id: an error of the claims that ask for it
            continue
        if different := sorted({*code} ^ one.code.keys()):
            raise UserError(
                f"{' on '.join(first)} and {' on '.join(names)} would share their trials, since their classes have one "
                f"name and revision, and equal fields: {', '.join(different)}. Write another `name` in one of them."
            )
