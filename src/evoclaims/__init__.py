"""evoclaims: claims of a paper as pytest tests over real trials, judged by exact statistics."""

from evoclaims.judging.verdict import Outcome
from evoclaims.suite.claim import claim, expected

__all__ = ["Outcome", "claim", "expected"]
