"""Every row of every level of every gate, against Python's integers."""

from __future__ import annotations

import pytest
from gate_oracles import GATES, Gate

gates = pytest.mark.parametrize("gate", GATES.values(), ids=list(GATES))


@gates
def test_every_row_of_every_level_is_what_integers_say(gate: Gate) -> None:
    table = gate.task.table
    assert len(table.rows_at_level) == gate.task.levels
    assert table.rows == len(table.inputs) == table.rows_at_level[-1]
    for level, rows in enumerate(table.rows_at_level):
        lines = gate.lines(level)
        assert rows == len(lines)
        for row, line in enumerate(lines):
            assert tuple(map(int, table.inputs[row])) == line.shown
            scored = tuple(
                int(bit) if active else None for bit, active in zip(table.targets[row], table.active[row], strict=True)
            )
            assert scored == line.wanted


def test_the_alu_has_the_rows_of_the_papers_table() -> None:
    assert GATES["ALU, list of paper, multiplexer of paper"].task.table.rows_at_level == (
        8, 12, 14, 18, 22, 38, 54, 70, 86,
    )  # fmt: skip
