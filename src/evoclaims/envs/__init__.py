"""Tasks: what methods are run on."""

from evoclaims.core.lazy import exported

__all__, __getattr__, __dir__ = exported(__name__)
