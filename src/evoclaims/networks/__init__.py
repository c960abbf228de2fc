"""Networks that policies are made of."""

from evoclaims.core.lazy import exported

__all__, __getattr__, __dir__ = exported(__name__)
