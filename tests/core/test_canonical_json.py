"""The same value always gives the same text, and nothing is put into words that the text cannot hold."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoclaims.core.canonical import as_plain, canonical_json, content_hash
from evoclaims.trials.spec import Budget

scalars = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text()
values = st.recursive(
    scalars, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4), max_leaves=12
)


@dataclass(frozen=True)
class Inner:
    rate: float = 0.5


@dataclass(frozen=True)
class Outer:
    name: str = "a"
    parts: tuple[Inner, ...] = (Inner(), Inner(1.0))
    note: str = field(default="not hashed", metadata={"canonical": False})


@given(values)
def test_it_is_ascii_json_of_the_same_value_without_spaces(value: Any) -> None:
    text = canonical_json(value)
    assert text.isascii()
    assert json.loads(text) == value
    assert text == json.dumps(json.loads(text), sort_keys=True, separators=(",", ":"))


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_float_comes_back_to_the_bit(number: float) -> None:
    back = json.loads(canonical_json(number))
    assert type(back) is float
    assert (back, math.copysign(1, back)) == (number, math.copysign(1, number))


def test_numbers_that_json_has_no_word_for_are_words() -> None:
    assert as_plain([math.nan, math.inf, -math.inf]) == ["nan", "inf", "-inf"]
    assert canonical_json({"x": (math.nan, -math.inf)}) == '{"x":["nan","-inf"]}'
    assert as_plain(np.float64("inf")) == "inf"
    assert canonical_json(np.float64(0.1)) == canonical_json(0.1) == "0.1"


def test_a_dataclass_is_its_fields_and_its_class_without_what_is_marked_as_not_canonical() -> None:
    parts = '[{"class":"Inner","rate":0.5},{"class":"Inner","rate":1.0}]'
    assert canonical_json(Outer()) == f'{{"class":"Outer","name":"a","parts":{parts}}}'
    assert canonical_json(Budget(generations=3)) == '{"environment_steps":null,"generations":3,"reports":50}'  # ours
    assert content_hash(Outer()) == content_hash(dataclasses.replace(Outer(), note="another"))
    assert content_hash(Outer()) != content_hash(dataclasses.replace(Outer(), name="b"))


def test_the_hash_is_the_sha_256_of_the_text() -> None:
    assert content_hash({"b": 1, "a": [True, None]}) == hashlib.sha256(b'{"a":[true,null],"b":1}').hexdigest()


@pytest.mark.parametrize(
    "value",
    [{1, 2}, b"bytes", 1j, object(), print, Outer, np.float32(1.0), np.bool_(True), np.int64(1), np.zeros(2), range(2)],
    ids=lambda value: type(value).__name__,
)
def test_what_has_no_canonical_form_is_a_type_error_that_names_the_type(value: Any) -> None:
    for nested in (value, [value], {"x": value}):
        with pytest.raises(TypeError, match=f"{type(value).__name__} has no canonical JSON form"):
            canonical_json(nested)


@pytest.mark.parametrize("key", [1, True, None, 0.5, ("a",)])
def test_a_key_that_is_no_text_is_a_type_error_and_not_mistaken_for_one(key: Any) -> None:
    """{1: …, "1": …} would otherwise lose an entry without a word."""
    with pytest.raises(TypeError, match="key"):
        canonical_json({key: 0})
