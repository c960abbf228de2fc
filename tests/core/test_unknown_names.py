"""A wrong name is answered with the known ones."""

from __future__ import annotations

import pytest

from evoclaims.core.errors import UnknownNameError, UserError

METHODS = ("neat", "cma_es", "ppo")


def test_an_unknown_name_lists_the_known_ones_in_order() -> None:
    error = UnknownNameError("method", "hyper", METHODS)
    assert isinstance(error, UserError)
    assert str(error) == "There is no method named 'hyper'. Known: cma_es, neat, ppo."


def test_a_near_miss_is_suggested() -> None:
    assert "named 'cma-es'. Did you mean 'cma_es'?" in str(UnknownNameError("method", "cma-es", METHODS))


@pytest.mark.parametrize("name", [None, 7, 0.5])
def test_a_name_that_is_no_text_is_answered_too(name: object) -> None:
    assert str(UnknownNameError("method", name, METHODS)) == (
        f"There is no method named {name}. Known: cma_es, neat, ppo."
    )
