"""evoclaims: claims of a paper as pytest tests over real trials, judged by exact statistics."""

from evoclaims.claims.claim import claim, expected
from evoclaims.judging.verdict import Outcome

__all__ = ["Outcome", "claim", "expected"]
