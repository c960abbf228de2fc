"""Random numbers drawn by a kernel are jax's own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from typing import Any, Final

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from assembler import kernels_for_gpus
from hypothesis import given
from hypothesis import strategies as st

from evoclaims.kernels.call.random_bits import kernel_prng
from evoclaims.kernels.emit import machine_code

DRAWS: Final[dict[str, Callable[..., Any]]] = {
    "bits": jax.random.bits,
    "bytes": lambda key, shape: jax.random.bits(key, shape, jnp.uint8),
    "uniform": jax.random.uniform,
    "normal": jax.random.normal,
    "bernoulli": lambda key, shape: jax.random.bernoulli(key, shape=shape),
}
SHAPES: Final = ((), (1,), (3,), (64,), (65,), (100, 3), (4, 0))


def _keys() -> Any:
    """Return keys that no test has used."""
    return jax.random.split(jax.random.key(11), 5)


def _numbers(keys: Any) -> Any:
    """Return what keys are made of."""
    return np.asarray(jax.random.key_data(keys))


@pytest.fixture(params=[1, 4, 16])
def _widths(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Machines with vectors of several widths."""
    monkeypatch.setattr(machine_code, "lanes", lambda: request.param)
    jax.clear_caches()  # of programs with vectors of another width
    yield
    jax.clear_caches()


@pytest.mark.usefixtures("_widths")
def test_every_draw_is_jaxs() -> None:
    def drawn(key: Any) -> Any:
        return _drawn(kernel_prng(key))

    wanted = _by_jax()
    jax.tree.map(np.testing.assert_array_equal, jax.jit(jax.vmap(drawn))(_keys()), wanted)
    jax.tree.map(np.testing.assert_array_equal, jax.jit(drawn)(_keys()[1]), jax.tree.map(lambda of: of[1], wanted))


def _drawn(key: Any) -> Any:
    """Draw numbers of every kind and of many shapes, in one program."""
    return {(name, shape): draw(key, shape) for name, draw in DRAWS.items() for shape in SHAPES}


@cache
def _by_jax() -> Any:
    """Return what jax draws from each key, whatever the width of a kernel's vectors."""
    return jax.device_get(jax.jit(jax.vmap(_drawn))(_keys()))


@pytest.mark.parametrize("name", DRAWS)
def test_a_draw_outside_of_a_program_is_jaxs(name: str) -> None:
    np.testing.assert_array_equal(DRAWS[name](kernel_prng(_keys()[1]), (5,)), DRAWS[name](_keys()[1], (5,)))


@given(st.integers(0, 2**32 - 1), st.integers(0, 2**32 - 1), st.integers(0, 2**32 - 1))
def test_a_key_folded_in_a_number_is_jaxs(first: int, second: int, number: int) -> None:
    plain = jax.random.wrap_key_data(jnp.array([first, second], jnp.uint32))
    assert (_numbers(_fold(kernel_prng(plain), jnp.uint32(number))) == _numbers(_fold(plain, jnp.uint32(number)))).all()


_fold = jax.jit(jax.random.fold_in)


@pytest.mark.parametrize("shape", [(), (1,), (7,), (3, 5), (0,), (2, 0)])
def test_keys_split_from_one_are_jaxs_and_such_keys_too(shape: tuple[int, ...]) -> None:
    made, wanted = jax.random.split(kernel_prng(_keys()[0]), shape), jax.random.split(_keys()[0], shape)
    np.testing.assert_array_equal(_numbers(made), _numbers(wanted))
    assert made.dtype == kernel_prng(_keys()).dtype != wanted.dtype


def test_many_keys_and_many_numbers_are_folded_as_by_jax() -> None:
    numbers = jnp.arange(15, dtype=jnp.uint32).reshape(3, 5)
    for many in (
        jax.vmap(jax.vmap(jax.random.fold_in, (0, None)), (None, 0)),  # [3] numbers with [5] keys
        jax.vmap(jax.vmap(jax.random.fold_in, (None, 0)), (0, None)),  # [5] keys with [3] numbers
    ):
        np.testing.assert_array_equal(
            _numbers(jax.jit(many)(kernel_prng(_keys()), numbers[:, 0])), _numbers(many(_keys(), numbers[:, 0]))
        )
    each = jax.vmap(jax.vmap(jax.random.fold_in), (None, 0))
    np.testing.assert_array_equal(
        _numbers(jax.jit(each)(kernel_prng(_keys()), numbers)), _numbers(each(_keys(), numbers))
    )


def test_one_program_draws_any_amount() -> None:
    """A kernel per size would be compiled for every shape that is drawn."""
    before = set(machine_code._libraries)
    for size in (5, 6, 700):
        jax.jit(lambda key, size=size: jax.random.bits(key, (size,)))(kernel_prng(_keys()[0]))
    assert len(set(machine_code._libraries) - before) <= 1


def test_nothing_of_xlas_loops_is_left_in_a_program_for_processors() -> None:
    def function(key: Any) -> Any:
        one, two = jax.random.split(jax.random.fold_in(key, 3))
        return jax.random.normal(one, (9,)), jax.random.randint(two, (), 0, 7)

    assert "while" in jax.jit(function).lower(_keys()[0]).as_text()
    assert "while" not in jax.jit(function).lower(kernel_prng(_keys()[0])).as_text()


def test_keys_of_other_generators_are_left_alone() -> None:
    key = jax.random.key(1, impl="rbg")
    assert kernel_prng(key) is key
    with jax.threefry_partitionable(False):
        assert kernel_prng(_keys()).dtype == _keys().dtype


def test_other_devices_draw_as_ever() -> None:
    assert not kernels_for_gpus(lambda key: jax.random.bits(kernel_prng(key), (9,)), _keys()[0])
