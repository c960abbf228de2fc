"""Whether planted faults (mutants) change a claim's verdict, and what the claim counts as."""

from __future__ import annotations

from enum import StrEnum

from evoclaims.judging.verdict import Outcome


class Tried(StrEnum):
    """The result of trying planted faults on a claim."""

    SENSITIVE = "sensitive"
    INSENSITIVE = "insensitive"
    NOT_TRIED = "not tried"


class Tally(StrEnum):
    """What a claim counts as: its outcome, unless that is support that no planted fault could have changed."""

    SUPPORTED = "supported"
    INSENSITIVE = "supported but insensitive"
    REFUTED = "refuted"
    SMALLER = "smaller than claimed"
    INCONCLUSIVE = "inconclusive"
    ERROR = "error"
    NOT_RUN = "not run"

    @property
    def symbol(self) -> str:
        """One character for tables: the outcome's."""
        return (Outcome.SUPPORTED if self is Tally.INSENSITIVE else Outcome(self.value)).symbol
