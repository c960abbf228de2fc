"""The variant of N-parity that asks the rows of all levels so far."""

from __future__ import annotations

import numpy as np
import pytest

from evoclaims.envs.gates.parity import CumulativeParity, NParity


@pytest.mark.parametrize("bits", [2, 3, 6])
def test_a_level_asks_the_tables_of_all_levels_so_far(bits: int) -> None:
    cumulative, plain = CumulativeParity(bits).table, NParity(bits).table
    assert cumulative.rows_at_level == tuple(int(n) for n in np.cumsum(plain.rows_at_level))
    begin = 0
    for level, end in enumerate(cumulative.rows_at_level):
        count = plain.rows_at_level[level]
        assert end - begin == count
        np.testing.assert_array_equal(cumulative.inputs[begin:end], plain.inputs[:count])
        np.testing.assert_array_equal(cumulative.targets[begin:end], plain.targets[:count])
        assert cumulative.active[begin:end].all()
        begin = end


def test_six_bits_ask_124_rows_on_the_last_of_five_levels() -> None:
    task = CumulativeParity(6)
    assert (task.levels, task.horizon, task.observation_size, task.action_size) == (5, 124, 6, 1)
