"""The exact binomial test, the sign test and the exact interval."""

from __future__ import annotations

from math import comb

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoclaims.judging.exact import binomial_test, clopper_pearson, sign_test


@given(st.integers(1, 20).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))), st.floats(0.05, 0.95))
def test_the_binomial_test_sums_the_tail(k_n: tuple[int, int], p0: float) -> None:
    k, n = k_n
    mass = [comb(n, j) * p0**j * (1 - p0) ** (n - j) for j in range(n + 1)]
    assert binomial_test(k, n, p0, "greater").p == pytest.approx(sum(mass[k:]), rel=1e-9)
    assert binomial_test(k, n, p0, "less").p == pytest.approx(sum(mass[: k + 1]), rel=1e-9)


def test_ten_of_ten_is_the_specifications_p_and_its_own_minimum() -> None:
    test = binomial_test(10, 10, 0.7)
    assert test.p == pytest.approx(0.028, abs=5e-4)
    assert test.attainable_p == test.p


def test_the_smallest_p_against_is_that_of_no_success() -> None:
    assert binomial_test(3, 5, 0.7, "less").attainable_p == pytest.approx(0.3**5)


def test_ten_of_ten_proves_only_0_741() -> None:
    low, high = clopper_pearson(10, 10)
    assert low == pytest.approx(0.741, abs=5e-4)
    assert high == 1.0


def test_nine_of_ten_pass_a_sign_test_and_eight_do_not() -> None:
    assert sign_test(9, 10).p <= 0.05 < sign_test(8, 10).p


@pytest.mark.parametrize("p0", [0.0, 1.0, -0.1])
def test_a_null_without_uncertainty_is_rejected(p0: float) -> None:
    with pytest.raises(ValueError, match="strictly between"):
        binomial_test(1, 2, p0)


def test_an_unknown_alternative_lists_the_known_ones() -> None:
    with pytest.raises(ValueError, match="greater, less"):
        binomial_test(1, 2, 0.5, "two-sided")  # type: ignore[arg-type]
