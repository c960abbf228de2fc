"""Do the published numbers replicate? Each beside ours, under the protocol and under its variants."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from evoclaims.core.errors import UnknownNameError
from evoclaims.figures.figure import Scope
from evoclaims.figures.trial_numbers import TrialNumbers, read
from evoclaims.judging.measure import Profile
from evoclaims.judging.repetition import Agreement, Answer, PublishedMean, Repetition, repetition
from evoclaims.paper.archive import Archive
from evoclaims.paper.reported import Published, Reported
from evoclaims.paper.reproduction import Reproduction


@dataclass(frozen=True)
class Replication:
    """A published number and ours.

    Attributes:
        tier: at which ours were made.
        variant: of the protocol; empty for the protocol itself.
        reported: the published number.
        numbers: ours, from each trial; of a profile's level, named as the profile is.
        repetition: whether ours are what a repetition of the published trials would give.
        level: of a profile, counted from 0; None for a measure without levels.
        jointly: the same, where all numbers of the condition have to be inside together; None for a single number.
    """

    tier: str
    variant: str
    reported: Reported
    numbers: TrialNumbers
    repetition: Repetition
    level: int | None = None
    jointly: Repetition | None = None

    @property
    def measure(self) -> str:
        """What is measured, such as "success at level 4"."""
        return self.numbers.name if self.level is None else f"{self.numbers.name} at level {self.level}"

    @property
    def name(self) -> str:
        """What is measured of which trials, such as "neat on n_parity: success at level 4"."""
        return f"{self.numbers.method} on {self.numbers.task}: {self.measure}"

    @property
    def agreement(self) -> Agreement:
        """Whether the number replicates."""
        return self.repetition.agreement

    @property
    def condition(self) -> tuple[str, str, str]:
        """What a curve is one result of: method, task and measure."""
        return self.numbers.method, self.numbers.task, self.numbers.name

    @property
    def holds_null(self) -> bool:
        """Whether some interval holds the value of an agent that does nothing, so that being inside says little."""
        null = self.reported.null
        return null is not None and any(
            one.low <= null <= one.high for one in self.repetition.predictions if one.of == "mean"
        )


def replications(
    archive: Archive, reproduction: Reproduction, tier: str, variants: Sequence[str] = ("",)
) -> tuple[Replication, ...]:
    """Return every published number beside ours; number by number, each under the variants in their order.

    A variant has a row only where it changes the trials behind a number, and some of these are at hand.

    Args:
        archive: our trials.
        reproduction: whose published numbers are asked for.
        tier: at which ours were made.
        variants: names of variants; "" for the protocol itself.

    Raises:
        UnknownNameError: for an unknown tier or variant.
        UserError: when the published numbers or a trial cannot be read.
    """
    published = reproduction.published
    scopes = [Scope(archive, reproduction, tier, variant) for variant in variants]
    changed = {variant: reproduction.changed_by(variant, tier) for variant in variants}
    found = []
    for quantity, method, task, at, reported in _numbers(published):
        for scope in scopes:
            names = method, task
            if scope.variant and names not in changed[scope.variant]:
                continue
            numbers, level = _ours(scope, quantity, method, task, at)
            if not scope.variant or numbers.values:
                many = len(published.plots[task][quantity]["methods"][method]["mean"])
                judged, jointly = (_judged(reported, numbers, len(scope.seeds), among) for among in (1, many))
                found.append(Replication(tier, scope.variant, reported, numbers, judged, level, jointly))
    return tuple(found)


def counts(found: Sequence[Replication]) -> Mapping[str, Mapping[Agreement, int]]:
    """Return, by variant, how many numbers have each answer."""
    return {name: Counter(one.agreement for one in of) for name, of in _by_variant(found).items()}


def counts_by_condition(found: Sequence[Replication]) -> Mapping[str, Mapping[Agreement, int]]:
    """Return, by variant, how many conditions have each answer; a curve is one condition, and one result.

    Contradicted where a level is outside the interval that all levels together are inside with 0.95 (Bonferroni);
    consistent where each level is.
    """
    totals: dict[str, Mapping[Agreement, int]] = {}
    for name, of in _by_variant(found).items():
        conditions: dict[tuple[str, str, str], list[Replication]] = {}
        for one in of:
            conditions.setdefault(one.condition, []).append(one)
        totals[name] = Counter(map(_together, conditions.values()))
    return totals


def _together(levels: Sequence[Replication]) -> Agreement:
    joint = {(one.jointly or one.repetition).agreement for one in levels}
    if Agreement.CONTRADICTED in joint:
        return Agreement.CONTRADICTED
    alone = {one.agreement for one in levels}
    if len(alone) == 1 and alone <= {Agreement.CONSISTENT, Agreement.OPEN}:
        return alone.pop()
    return Agreement.UNINFORMATIVE


def _by_variant(found: Sequence[Replication]) -> Mapping[str, list[Replication]]:
    by_variant: dict[str, list[Replication]] = {}
    for one in found:
        by_variant.setdefault(one.variant, []).append(one)
    return by_variant


def _numbers(published: Published) -> Iterator[tuple[str, str, str, int, Reported]]:
    """Yield each number of the plots, in the order of the file: quantity, method, task, place on the axis, number.

    A number that the file has under two quantities (the last level's, and its own) is yielded once.
    """
    for task, quantities in published.plots.items():
        seen = set[tuple[str, Reported, bool]]()
        for quantity, plot in quantities.items():
            for method, numbers in plot["methods"].items():
                is_curve, last = len(numbers["mean"]) > 1, len(numbers["mean"]) - 1
                for at in range(last + 1):
                    reported = published.value(task, quantity, method, at)
                    if reported is None or (at == last and (method, reported, not is_curve) in seen):
                        continue
                    seen |= {(method, reported, is_curve)} if at == last else set()
                    yield quantity, method, task, at, reported


def _ours(scope: Scope, quantity: str, method: str, task: str, at: int) -> tuple[TrialNumbers, int | None]:
    """Read our trials, and say of which level: None of a measure without levels.

    There are no numbers where the tier has no such condition, or its task no such level.
    """
    try:
        found = getattr(scope.group(method, task), quantity)
    except UnknownNameError:
        if (method, task) in scope.tier.conditions:
            raise
        return TrialNumbers(method, task, quantity, ()), None
    if not isinstance(found, Profile):
        return read(scope, method, task, lambda group: getattr(group, quantity)), None
    if at >= found.size:
        return TrialNumbers(method, task, found.name, ()), at
    numbers = read(scope, method, task, lambda group: getattr(group, quantity).at(at))
    return replace(numbers, name=found.name), at


def _judged(reported: Reported, numbers: TrialNumbers, planned: int, among: int) -> Repetition:
    if reported.trials is None:
        return Repetition((), Answer.UNKNOWN, "reported.toml does not say of how many trials the number is the mean")
    mean = PublishedMean(reported.value, reported.error, reported.trials, reported.scale, reported.precision)
    return repetition(mean, numbers.values, planned, numbers.broken, among)
