"""Text that steers no terminal, and that every terminal has signs for."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.core.printable import printable, shown, spelled

anything = st.text(st.characters(exclude_categories=()))  # stray surrogates included


@given(anything)
def test_what_is_shown_steers_nothing_and_says_the_same(text: str) -> None:
    assert printable(text).isprintable()
    assert shown(text).replace("\n", "").replace("\t", "").isprintable()
    assert shown(text).count("\n") == text.count("\n")
    if text.isprintable():
        assert printable(text) == shown(text) == text


@given(anything, st.sampled_from(["ascii", "latin-1", "utf-8", None, "no such encoding"]))
def test_what_is_spelled_can_be_written(text: str, encoding: str | None) -> None:
    spelled(shown(text), encoding).encode(encoding if encoding not in (None, "no such encoding") else "utf-8")


def test_the_signs_of_a_table_have_plain_ones() -> None:
    assert spelled("✓ × – α €", "ascii") == "+ x - alpha \\u20ac"
    assert spelled("✓", "utf-8") == "✓"


@given(anything)
def test_a_users_mistake_is_told_without_obeying_it(text: str) -> None:
    for error in (UserError(f"no {text}"), UnknownNameError("claim", text, [text])):
        assert str(error).replace("\n", "").replace("\t", "").isprintable()
