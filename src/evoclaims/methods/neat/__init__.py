"""NEAT (Stanley and Miikkulainen 2002) with TensorNEAT's semantics, written for accelerators."""

from evoclaims.core.lazy import exported

__all__, __getattr__, __dir__ = exported(__name__)
