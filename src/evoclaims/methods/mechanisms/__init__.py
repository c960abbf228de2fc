"""Methods that take the steps of another one and report what its parts did, for claims about mechanisms."""

from evoclaims.core.lazy import exported

__all__, __getattr__, __dir__ = exported(__name__)
