"""Whether planted faults (mutants) change a claim's verdict, and what the claim counts as."""

from __future__ import annotations

from enum import StrEnum
from typing import Final

from evoclaims.judging.verdict import Outcome


class Tried(StrEnum):
    """The result of trying planted faults on a claim."""

    SENSITIVE = "sensitive"
    INSENSITIVE = "insensitive"
    NOT_TRIED = "not tried"


class Tally(StrEnum):
    """What a claim counts as: its outcome, unless no planted fault changes its support, or a null agent has it, too."""

    SUPPORTED = "supported"
    INSENSITIVE = "supported but insensitive"
    VACUOUS = "supported but vacuous"
    REFUTED = "refuted"
    SMALLER = "smaller than claimed"
    INCONCLUSIVE = "inconclusive"
    ERROR = "error"
    NOT_RUN = "not run"

    @property
    def symbol(self) -> str:
        """One character for tables: the outcome's."""
        return (Outcome.SUPPORTED if self in APART else Outcome(self.value)).symbol


APART: Final = (Tally.INSENSITIVE, Tally.VACUOUS)
"""Support that is counted apart; tables leave it out where it is 0."""
