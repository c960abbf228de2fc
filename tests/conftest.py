"""Settings of every test: no deadlines, two CPU devices, quick compilation, one compilation cache for all processes."""

from __future__ import annotations

import gc
import importlib
import os
import pkgutil
import shutil
import signal
import sys
import warnings
from collections.abc import Iterator
from functools import cached_property
from importlib.metadata import EntryPoints, PackagePath, PathDistribution, distributions, version
from pathlib import Path
from typing import Final

import pytest
from hypothesis import settings
from temporary_folders import temporary_folder

pytest_plugins = ["hand_made_paper", "pytester", "tiny_project"]

# No test fails on a slow machine for being slow.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")

# Tracing makes many small objects that live: looking through all of them often took a seventh of the time.
gc.set_threshold(100_000, 20, 20)

_CACHE: Final = "JAX_COMPILATION_CACHE_DIR"
_made = ""
_MOST_RESIDENT: Final = 10**9
"""Bytes from which on compiled programs are forgotten after a module."""

# Before anything imports jax; environment variables, so that xdist workers and subprocesses see the same.
os.environ.setdefault("JAX_PLATFORMS", "cpu")
os.environ.setdefault("JAX_NUM_CPU_DEVICES", "2")
# Nearly all that a test compiles runs for less time than it compiles.
_QUICK: Final = ["--xla_backend_optimization_level=0", "--xla_llvm_disable_expensive_passes=true"]
if version("jaxlib").startswith("0.10."):  # newer ones do not know this flag
    _QUICK.append("--xla_cpu_use_fusion_emitters=false")  # half of the time
os.environ.setdefault("XLA_FLAGS", " ".join(_QUICK))
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as in what a shell runs in the background
    signal.signal(signal.SIGINT, signal.default_int_handler)
if _CACHE not in os.environ:
    _made = os.environ[_CACHE] = str(temporary_folder("evoclaims-tests-"))
    os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0"  # an entry is read ten times as fast as compiled

from evoclaims.trials.devices import give_back, share_heaps  # noqa: E402  (it imports jax, which reads what is set above)

share_heaps()  # as a run does, before jax makes its threads


def pytest_configure(config: pytest.Config) -> None:
    """Refuse claims beside tests: their trials would be compiled with the flags above, and have other bits."""
    here = Path(__file__).parent
    places = [(config.invocation_params.dir / arg.partition("::")[0]).resolve() for arg in config.args]
    if strange := [str(place) for place in places if not place.is_relative_to(here)]:
        raise pytest.UsageError(f"Run `pytest tests` alone, without {', '.join(strange)}: it compiles otherwise.")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the folders whose tests take longest: at the end one worker would be left with them."""
    items.sort(key=lambda item: item.path.parent.name not in ("torture", "upgrade"))


def pytest_unconfigure(config: pytest.Config) -> None:
    """Remove the compilation cache that this process made."""
    if _made:
        shutil.rmtree(_made, ignore_errors=True)
        os.environ.pop(_CACHE, None)


@pytest.fixture(scope="module", autouse=True)
def bounded_memory() -> Iterator[None]:
    """Forget compiled programs after a module where they fill the memory: jax keeps all of them."""
    yield
    if "jax" in sys.modules and _resident() > _MOST_RESIDENT:
        sys.modules["jax"].clear_caches()
        give_back()


def _resident() -> int:
    """Return the bytes of memory that this process takes; 0 where Linux does not tell."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        return 0


@pytest.fixture(scope="session")
def all_imported() -> None:
    """Every module, and what a run of pytest imports when it comes to it."""
    import evoclaims

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of Brax's requirements
        for module in pkgutil.walk_packages(evoclaims.__path__, "evoclaims."):
            importlib.import_module(module.name)
    for name in ("brax.training.agents.ppo.losses", "hypothesis", "statsmodels.stats.multitest"):
        importlib.import_module(name)


class Installed(PathDistribution):
    """An installed package whose entry points and files are read once for all runs of pytest in this process."""

    @cached_property
    def entry_points(self) -> EntryPoints:  # type: ignore[override]
        return super().entry_points

    @cached_property
    def files(self) -> list[PackagePath] | None:  # type: ignore[override]
        return super().files


@pytest.fixture(scope="session")
def installed() -> list[Installed]:
    return [Installed(Path(str(package._path))) for package in distributions()]


@pytest.fixture
def pytester(
    all_imported: None, installed: list[Installed], pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> Iterator[pytest.Pytester]:
    """pytest's own, which forgets the modules that a test has imported first: their classes would be there twice."""
    monkeypatch.setattr("importlib.metadata.distributions", lambda: installed)
    gc.freeze()  # every run of pytest ends with five garbage collections, of all that earlier tests have traced
    yield pytester
    gc.unfreeze()
