"""Errors for people: an exception in one line, and a wrong name is answered with the known ones."""

from __future__ import annotations

from pathlib import Path

import jax
import pytest

from evoclaims.core.errors import UnknownNameError, UserError, in_one_line


def test_an_if_on_a_traced_number_leads_to_the_page_that_says_what_to_write_instead(tmp_path: Path) -> None:
    with pytest.raises(jax.errors.TracerBoolConversionError) as raised:
        jax.make_jaxpr(lambda x: x if x > 0 else -x)(1.0)
    told = in_one_line(raised.value, tmp_path)
    assert told.startswith("TracerBoolConversionError: Attempted boolean conversion of traced array")
    assert "; see https://" in told
    assert "#jax.errors.TracerBoolConversionError (" in told
    assert "\n" not in told


@pytest.mark.parametrize("message", ["one", "one\ntwo", "one\nSee page 3"])
def test_of_other_messages_the_first_line_is_told(message: str, tmp_path: Path) -> None:
    assert in_one_line(ValueError(message), tmp_path) == "ValueError: one"


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
