"""Every test of a method runs without implicit promotions, and shares each method's compiled step."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from typing import Any

import jax
import pytest
from small_methods import BENCHES, METHODS, Entry
from workbench import Workbench


@pytest.fixture(autouse=True)
def _strictly() -> Iterator[None]:
    """Run every test without implicit promotions and with every key used once."""
    with jax.numpy_dtype_promotion("strict"), jax.numpy_rank_promotion("raise"), jax.debug_key_reuse(True):
        yield


@pytest.fixture(params=METHODS)
def name(request: pytest.FixtureRequest) -> str:
    """Each method's name in turn."""
    return str(request.param)


@pytest.fixture
def entry(name: str) -> Entry:
    """The method's entry in the table."""
    found = METHODS[name]
    if found.needs and importlib.util.find_spec(found.needs) is None:
        pytest.skip(f"{name} is not checked: {found.needs} is not installed")
    return found


@pytest.fixture
def bench(name: str, entry: Entry) -> Workbench:
    """The method with its compiled step, which the tests share."""
    return BENCHES[name]


@pytest.fixture
def cpus() -> list[Any]:
    """The CPU device that the engine runs trials on: one compiles faster than two."""
    return list(jax.devices("cpu")[:1])


@pytest.fixture
def benches() -> dict[str, Workbench]:
    """Every method with its compiled step."""
    return BENCHES
