"""An exception in one line: what was raised, where to read more, and where in the user's files."""

from __future__ import annotations

from pathlib import Path

import jax
import pytest

from evoclaims.core.errors import in_one_line


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
