"""Planted faults (mutation analysis): claims that no fault in their methods or tasks can change say nothing.

DeMillo, Lipton and Sayward 1978, Hints on test data selection, IEEE Computer 11(4).
"""

from evoclaims.core.lazy import exported

__all__, __getattr__, __dir__ = exported(__name__)
