"""Tasks: what a method is tried on."""

from evoclaims.core.lazy import exported

__all__, __getattr__, __dir__ = exported(__name__)
