"""What a claim's test calls as `verdict`: it takes the test's assertion, and other readings of the sentence."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from evoclaims.claims.report_making import Reading
from evoclaims.core.errors import UserError
from evoclaims.judging.assertion import Assertion
from evoclaims.judging.measure import Event, Measure, Profile
from evoclaims.verdicts.readings import moment


@dataclass
class VerdictFixture:
    """Takes exactly one assertion per test, settles it, and keeps its report."""

    settle: Callable[[Assertion, Sequence[Reading]], object]
    report: Any = None
    readings: list[Reading] = field(default_factory=list)

    def __call__(self, assertion: Assertion) -> None:
        """Judge the claim's assertion.

        Raises:
            UserError: for a second assertion, or a value that is not one.
        """
        if not isinstance(assertion, Assertion):
            if isinstance(assertion, Event):
                raise UserError(
                    f"verdict(...) takes an assertion about trials, not {assertion.name!r} alone: say in how many it "
                    "holds, as in .in_most_trials() or .in_every_trial()."
                )
            alone = isinstance(assertion, Measure | Profile)
            if callable(assertion):
                name = getattr(assertion, "__name__", type(assertion).__name__)
                raise UserError(f"verdict(...) was given the function {name} itself: call it, as in {name}().")
            raise UserError(
                f"verdict(...) takes an assertion about trials, such as verdict(a.mean_success > b.mean_success), "
                f"not {f'{assertion.name!r} alone: compare it with something' if alone else repr(assertion)}."
            )
        if self.report is not None:
            raise UserError("A claim has one verdict: join several assertions with & (and) or | (or).")
        self.report = self.settle(assertion, self.readings)

    def reading(self, name: str, assertion: Assertion, *, because: str, since: str) -> None:
        """Add another reading of the claim's sentence, before `verdict(...)`: the verdict shows whether it depends.

        It counts where the paper's own sentence is judged, not at a tier with a smaller statement.

        Args:
            name: a few words.
            assertion: what the sentence says if it is read so.
            because: why it may be read so.
            since: when the reading was written, such as "2026-11-26" or "2026-11-26 14:30" (UTC).

        Raises:
            UserError: after the verdict, for a name that is taken, a missing text, or something else than a date or an
                assertion.
        """
        if self.report is not None:
            raise UserError(f"The reading {name!r} comes after the verdict: write verdict.reading(...) before it.")
        if not isinstance(assertion, Assertion):
            raise UserError(
                f"The reading {name!r} is {assertion!r}, which is not an assertion. Write one, as for verdict(...)."
            )
        if not (name.strip() and because.strip()) or name in (one.name for one in self.readings):
            raise UserError(f"The reading {name!r} needs a unique name and because=...: why the sentence means this.")
        moment(since)
        self.readings.append(Reading(name, assertion, because, since))
