"""Designs that cannot be carried out are rejected in one sentence."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from evoclaims.core.errors import UserError
from evoclaims.judging.design import FIXED_10, SEQUENTIAL, Design, Look


def test_the_presets_are_the_specifications() -> None:
    assert FIXED_10.looks == (Look(10, 0.05),)
    assert SEQUENTIAL.looks == (Look(5, 0.01), Look(10, 0.04))
    assert SEQUENTIAL.alpha == pytest.approx(0.05)
    assert (FIXED_10.p0, FIXED_10.a12_margin, FIXED_10.seeds(3)) == (0.7, 0.71, (0, 1, 2))


def test_a_fixed_design_looks_once() -> None:
    assert Design.fixed(7).looks == (Look(7, 0.05),)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: Look(0, 0.05), "1 to 100 trials"),
        (lambda: Look(101, 0.05), "1 to 100 trials"),
        (lambda: Look(10, 0.0), "alpha"),
        (lambda: Look(10, 1.0), "alpha"),
        (lambda: Design(()), "at least one look"),
        (lambda: Design((Look(5, 0.01), Look(5, 0.04))), "more than the one before"),
        (lambda: Design((Look(5, 0.5), Look(6, 0.5))), "add up to 1. Their sum must be below 1"),
        (lambda: Design((Look(5, 0.05),), p0=1.0), "p0"),
        (lambda: Design((Look(5, 0.05),), a12_margin=0.4), "A12 margin"),
        (lambda: Design((Look(5, 0.05),), first_seed=-1), "first seed is -1. It must be at least 0"),
    ],
)
def test_an_impossible_design_is_rejected_in_a_sentence(make: Callable[[], object], sentence: str) -> None:
    with pytest.raises(UserError, match=sentence):
        make()
