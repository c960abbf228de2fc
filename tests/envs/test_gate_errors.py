"""Gates that cannot be: one sentence each, with what is known."""

from __future__ import annotations

from typing import Any

import pytest

from evoclaims.core.errors import UserError
from evoclaims.envs.gates.alu import SimpleAlu
from evoclaims.envs.gates.parity import NParity


@pytest.mark.parametrize("bits", [-1, 0, 1, 13])
def test_an_impossible_number_of_bits_is_named_with_the_possible_ones(bits: int) -> None:
    with pytest.raises(UserError, match=rf"N-parity has bits={bits}\. Write a number from 2 to 12"):
        NParity(bits)


@pytest.mark.parametrize("levels", [-1, 0, 10])
@pytest.mark.parametrize("operations", ["paper", "published_code"])
def test_an_impossible_number_of_levels_is_named_with_the_possible_ones(levels: int, operations: Any) -> None:
    with pytest.raises(UserError, match=rf"Simple ALU has level_count={levels}\. Write a number from 1 to 9"):
        SimpleAlu(levels, operations=operations)


@pytest.mark.parametrize("task", [NParity, SimpleAlu])
def test_a_misspelt_sampling_lists_the_known_ones_and_guesses(task: Any) -> None:
    with pytest.raises(UserError, match=r"'one-step'.* Known: exhaustive, sampled\."):
        task(sampling="one-step")
    with pytest.raises(UserError, match=r"'samplde'\. Did you mean 'sampled'\?"):
        task(sampling="samplde")


@pytest.mark.parametrize("field", ["operations", "multiplexer"])
def test_a_misspelt_variant_of_the_alu_lists_the_known_ones(field: str) -> None:
    with pytest.raises(UserError, match=r"named 'papre'\. Did you mean 'paper'\? Known: paper, published_code\."):
        SimpleAlu(**{field: "papre"})  # type: ignore[arg-type]


@pytest.mark.parametrize("wrong", [None, 3, True])
def test_a_name_that_is_no_text_is_answered_like_any_wrong_name(wrong: Any) -> None:
    with pytest.raises(UserError, match=rf"named {wrong!r}\. .*Known: exhaustive, sampled\."):
        NParity(sampling=wrong)


def test_a_smaller_alu_is_the_beginning_of_the_whole() -> None:
    whole = SimpleAlu()
    for count in range(1, 10):
        part = SimpleAlu(count)
        assert part.levels == count
        assert part.table.rows_at_level == whole.table.rows_at_level[:count]
        assert (part.table.inputs == whole.table.inputs[: part.table.rows]).all()
        assert (part.table.targets == whole.table.targets[: part.table.rows]).all()
