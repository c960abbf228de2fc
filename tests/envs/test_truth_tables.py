"""Every row of every level of every gate, against Python's integers."""

from __future__ import annotations

import numpy as np
import pytest
from gate_oracles import GATES, OPERATIONS, Gate
from hypothesis import given
from hypothesis import strategies as st

from evoclaims.envs.gates.parity import NParity

gates = pytest.mark.parametrize("gate", GATES.values(), ids=list(GATES))


@gates
def test_every_row_of_every_level_is_what_integers_say(gate: Gate) -> None:
    table = gate.task.table
    assert len(table.rows_at_level) == gate.task.levels
    for level, rows in enumerate(table.rows_at_level):
        lines = gate.lines(level)
        assert rows == len(lines)
        for row, line in enumerate(lines):
            assert tuple(map(int, table.inputs[row])) == line.shown
            scored = tuple(
                int(bit) if active else None for bit, active in zip(table.targets[row], table.active[row], strict=True)
            )
            assert scored == line.wanted


@gates
def test_a_level_begins_with_the_level_before(gate: Gate) -> None:
    rows = gate.task.table.rows_at_level
    assert list(rows) == sorted(set(rows))
    for level in range(1, gate.task.levels):
        assert gate.lines(level)[: rows[level - 1]] == gate.lines(level - 1)
    assert gate.task.table.rows == len(gate.task.table.inputs) == rows[-1]


@gates
def test_no_row_is_asked_twice(gate: Gate) -> None:
    assert len({tuple(row) for row in gate.task.table.inputs}) == gate.task.table.rows


def test_the_alu_has_the_rows_of_the_papers_table() -> None:
    assert GATES["ALU, list of paper, multiplexer of paper"].task.table.rows_at_level == (
        8, 12, 14, 18, 22, 38, 54, 70, 86,
    )  # fmt: skip


def test_the_published_list_has_xax_and_no_shift_right() -> None:
    paper = GATES["ALU, list of paper, multiplexer of paper"].task.operation_list
    published = GATES["ALU, list of published_code, multiplexer of paper"].task.operation_list
    assert {operation.name for operation in paper} - {operation.name for operation in published} == {"shift right"}
    assert {operation.name for operation in published} - {operation.name for operation in paper} == {"xax"}
    assert {operation.name for operation in (*paper, *published)} <= set(OPERATIONS)


def test_inactive_inputs_are_0() -> None:
    for bits in range(2, 9):
        for level, rows in enumerate(NParity(bits).table.rows_at_level):
            assert not NParity(bits).table.inputs[:rows, : bits - level - 2].any()
    for gate in (gate for name, gate in GATES.items() if "ALU" in name):
        for index, operation in enumerate(gate.task.operation_list):
            its_rows = [line.shown for line in gate.last if line.shown[:4] == tuple(map(int, f"{index:04b}"))]
            assert len(its_rows) == 2**operation.inputs
            assert not np.array(its_rows)[:, 4 : 8 - operation.inputs].any()


@given(bits=st.integers(2, 8), data=st.data())
def test_parity_flips_with_any_one_bit(bits: int, data: st.DataObject) -> None:
    table = NParity(bits).table
    number = data.draw(st.integers(0, 2**bits - 1))
    flipped = number ^ (1 << data.draw(st.integers(0, bits - 1)))
    assert table.targets[number, 0] != table.targets[flipped, 0]
