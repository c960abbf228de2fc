"""Settings of every test: no deadlines, two CPU devices, quick compilation, one compilation cache for all processes."""

from __future__ import annotations

import os
import shutil
import tempfile
from typing import Final

import pytest
from hypothesis import settings

pytest_plugins = ["hand_made_paper", "pytester", "tiny_project"]

# No test fails on a slow machine for being slow.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")

_CACHE: Final = "JAX_COMPILATION_CACHE_DIR"
_made = ""

# Before anything imports jax; environment variables, so that xdist workers and subprocesses see the same.
os.environ.setdefault("JAX_PLATFORMS", "cpu")
os.environ.setdefault("JAX_NUM_CPU_DEVICES", "2")
# Nearly all that a test compiles runs for less time than it compiles.
os.environ.setdefault("XLA_FLAGS", "--xla_backend_optimization_level=0 --xla_llvm_disable_expensive_passes=true")
if _CACHE not in os.environ:
    _made = os.environ[_CACHE] = tempfile.mkdtemp(prefix="evoclaims-tests-")
    os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0.1"


def pytest_unconfigure(config: pytest.Config) -> None:
    """Remove the compilation cache that this process made."""
    if _made:
        shutil.rmtree(_made, ignore_errors=True)
        os.environ.pop(_CACHE, None)
