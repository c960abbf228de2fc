"""Compiles functions of small arrays to single kernels; README.md beside this file explains how."""

from evoclaims.core.lazy import exported

__all__, __getattr__, __dir__ = exported(__name__)
