"""The readings of a sentence: what it may mean, how each is judged, and whether the verdict depends on the reading."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from evoclaims.core.errors import UserError
from evoclaims.judging.verdict import Outcome


@dataclass(frozen=True)
class ReadAs:
    """One reading of a claim's sentence, judged.

    Attributes:
        name: a few words.
        because: why the sentence may be read so.
        since: when the reading was written (ISO 8601, UTC); empty where nobody says.
        asserts: the assertion in plain English.
        outcome: of it.
        trials_since: when the first of its trials started (ISO 8601); empty where no record says.
    """

    name: str
    because: str
    since: str
    asserts: str
    outcome: Outcome
    trials_since: str = ""

    @property
    def late(self) -> bool:
        """Whether the reading was written after its trials ran, so that it may have been chosen by their result."""
        return bool(self.since and self.trials_since) and moment(self.since) > moment(self.trials_since)


def moment(text: str) -> datetime:
    """Return a date, or a date and time; UTC if it names no zone.

    Raises:
        UserError: when it is neither.
    """
    try:
        found = datetime.fromisoformat(text)
    except (TypeError, ValueError):
        raise UserError(f"{text!r} is not a date: write it as 2026-11-26, or 2026-11-26 14:30 (UTC).") from None
    return found if found.tzinfo else found.replace(tzinfo=UTC)


def depends(readings: Sequence[ReadAs]) -> bool:
    """Whether two readings of a sentence end otherwise; those that were not judged say nothing."""
    return len({one.outcome for one in readings if one.outcome.judged}) > 1


def by_reading(readings: Sequence[ReadAs]) -> str:
    """Return how readings end, such as "supported under all 3 readings" or "depends on the reading: ...".

    Empty where fewer than two are judged.
    """
    judged = [one for one in readings if one.outcome.judged]
    if len(judged) < 2:
        return ""
    if not depends(judged):
        return f"{judged[0].outcome} under all {len(judged)} readings"
    ended = {outcome: [f"“{one.name}”" for one in judged if one.outcome is outcome] for outcome in Outcome}
    ends = "; ".join(f"{outcome} as {', '.join(names)}" for outcome, names in ended.items() if names)
    return f"depends on the reading: {ends}"
