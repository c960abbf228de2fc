"""Random numbers drawn by a kernel are jax's own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Final

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from assembler import kernels_for_gpus

from evoclaims.kernels import machine_code, random_bits
from evoclaims.kernels.random_bits import fast

DRAWS: Final[dict[str, Callable[..., Any]]] = {
    "bits": jax.random.bits,
    "bytes": lambda key, shape: jax.random.bits(key, shape, jnp.uint8),
    "uniform": jax.random.uniform,
    "normal": jax.random.normal,
    "bernoulli": lambda key, shape: jax.random.bernoulli(key, shape=shape),
}


def _keys() -> Any:
    """Return keys that no test has used."""
    return jax.random.split(jax.random.key(11), 5)


@pytest.fixture(params=[1, 4, 16])
def _widths(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Machines with vectors of several widths."""
    monkeypatch.setattr(machine_code, "lanes", lambda: request.param)
    random_bits._kernel.cache_clear()
    yield
    random_bits._kernel.cache_clear()


@pytest.mark.usefixtures("_widths")
@pytest.mark.parametrize("shape", [(), (1,), (65,), (100, 3), (4, 0)])
def test_every_draw_is_jaxs(shape: tuple[int, ...]) -> None:
    for draw in DRAWS.values():
        made, wanted = draw(fast(_keys()[1]), shape), draw(_keys()[1], shape)
        np.testing.assert_array_equal(made, wanted)
        many = jax.jit(jax.vmap(lambda key, draw=draw: draw(fast(key), shape)))(_keys())
        np.testing.assert_array_equal(many, jax.vmap(lambda key, draw=draw: draw(key, shape))(_keys()))


def test_keys_derived_from_one_are_jaxs() -> None:
    for derive in (jax.random.split, lambda key: jax.random.fold_in(key, 7)):
        made, wanted = derive(fast(_keys()[0])), derive(_keys()[0])
        np.testing.assert_array_equal(jax.random.key_data(made), jax.random.key_data(wanted))


def test_keys_of_other_generators_are_left_alone() -> None:
    key = jax.random.key(1, impl="rbg")
    assert fast(key) is key
    with jax.threefry_partitionable(False):
        assert fast(_keys()).dtype == _keys().dtype


def test_other_devices_draw_as_ever() -> None:
    assert not kernels_for_gpus(lambda key: jax.random.bits(fast(key), (9,)), _keys()[0])
