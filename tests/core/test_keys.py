"""Streams of keys are told apart by name alone."""

from __future__ import annotations

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evoclaims.core.keys import EVALUATION, TRAINING, stream, streams, trial_key

names = st.lists(st.text(max_size=12), min_size=1, max_size=6, unique=True)


def _bits(key: jax.Array) -> tuple[int, ...]:
    return tuple(np.asarray(jax.random.key_data(key)).ravel().tolist())


@settings(max_examples=30, deadline=None)
@given(known=names)
def test_streams_are_one_stream_each_and_differ_by_name(known: list[str]) -> None:
    key = jax.random.key(7)
    made = [_bits(one) for one in streams(key, *known)]
    assert made == [_bits(stream(key, name)) for name in known]
    assert len(set(made)) == len(known)
    assert _bits(key) not in made


def test_a_name_means_the_same_key_on_every_machine() -> None:
    """Written down once: another hash of the name would make every stored trial another trial."""
    assert _bits(stream(jax.random.key(0), "training")) == GOLDEN


GOLDEN = (3268962144, 3417553706)


def test_training_and_evaluation_never_meet_over_many_seeds() -> None:
    seeds = np.arange(20_000, dtype=np.int32)
    roots = {
        purpose: np.asarray(jax.random.key_data(jax.jit(jax.vmap(lambda s, p=purpose: trial_key(s, p)))(seeds)))
        for purpose in (TRAINING, EVALUATION)
    }
    together = {tuple(row) for purpose in roots for row in roots[purpose].tolist()}
    assert len(together) == 2 * len(seeds)


@pytest.mark.parametrize("seed", [0, 1, 123456, 2**31 - 1])
def test_a_traced_seed_gives_the_key_of_the_number(seed: int) -> None:
    traced = jax.jit(lambda s: jax.random.key_data(trial_key(s, TRAINING)))(np.int32(seed))
    assert tuple(np.asarray(traced).tolist()) == _bits(trial_key(seed, TRAINING))


def test_keys_are_typed_and_deriving_streams_does_not_use_a_key_up() -> None:
    with jax.debug_key_reuse(True):
        key = jax.random.key(0)
        one, other = streams(key, "one", "other")
        assert jax.numpy.issubdtype(one.dtype, jax.dtypes.prng_key)
        assert one.shape == ()
        assert float(jax.random.normal(one)) != float(jax.random.normal(other))
        with pytest.raises(jax.errors.KeyReuseError):
            jax.random.normal(one)
