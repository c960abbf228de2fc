"""evoclaims: claims of a paper as pytest tests over real trials, judged by exact statistics.

What claims and reproductions are written with; `envs`, `methods`, `networks` and `figures` have the rest (docs/api.md).
"""

from evoclaims.core.lazy import exported

__all__, __getattr__, __dir__ = exported(__name__)
