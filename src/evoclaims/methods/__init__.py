"""Algorithms: pure functions of an explicit state, one per file."""

from evoclaims.core.lazy import exported

__all__, __getattr__, __dir__ = exported(__name__)
