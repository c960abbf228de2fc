"""A wrong name is answered with the known ones."""

from __future__ import annotations

from typing import Any

import pytest

from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.core.registry import Registry

METHODS = Registry("method", {"neat": 1, "cma_es": 2, "ppo": 3})


def test_a_known_name_gives_its_entry() -> None:
    assert METHODS["cma_es"] == 2
    assert dict(METHODS) == {"neat": 1, "cma_es": 2, "ppo": 3}


def test_it_is_a_mapping_in_the_order_of_registration() -> None:
    assert list(METHODS) == ["neat", "cma_es", "ppo"]
    assert len(METHODS) == 3
    assert "ppo" in METHODS
    assert "pppo" not in METHODS


def test_an_unknown_name_lists_the_known_ones_in_order() -> None:
    with pytest.raises(UserError) as caught:
        METHODS["hyper"]
    assert str(caught.value) == "There is no method named 'hyper'. Known: cma_es, neat, ppo."


def test_a_near_miss_is_suggested() -> None:
    with pytest.raises(UnknownNameError, match=r"named 'cma-es'\. Did you mean 'cma_es'\?"):
        METHODS["cma-es"]


@pytest.mark.parametrize("name", [None, 7, 0.5])
def test_a_name_that_is_no_text_is_answered_too(name: Any) -> None:
    with pytest.raises(UserError, match=rf"named {name}\..* Known: cma_es, neat, ppo\."):
        METHODS[name]


def test_a_default_is_given_for_an_unknown_name() -> None:
    assert METHODS.get("map_elites") is None
    assert METHODS.get("map_elites", 9) == 9
    assert METHODS.get("ppo", 9) == 3


def test_what_it_was_made_from_may_change_afterwards() -> None:
    entries = {"one": 1}
    registry = Registry("number", entries)
    entries["two"] = 2
    assert list(registry) == ["one"]
