"""Runs functions in jax that are kernels otherwise, so that both can be compared."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

from evoclaims.kernels.call.grouped import GroupKernel

BREEDING = ("The breeding of genomes",)
"""The name of the kernels of NEAT that are not its networks'."""


@contextmanager
def without_kernels(names: Sequence[str]) -> Iterator[None]:
    """While functions are traced, let the kernels of these names be what they are in jax."""
    call = GroupKernel.__call__

    def chosen(kernel: GroupKernel, *leaves: Any) -> list[Any]:
        return list(kernel.function(*leaves)) if kernel.name in names else call(kernel, *leaves)

    with patch.object(GroupKernel, "__call__", chosen):
        yield
