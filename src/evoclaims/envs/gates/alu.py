"""Simple ALU: one circuit that switches between logical operations by control bits (§3.1.2 of the paper)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Literal, get_args

import numpy as np

from evoclaims.core.errors import UserError, require_known
from evoclaims.envs.gates.circuit import Circuit, Operation, Sampling, TruthTable, bits_of, number_of

WIDTH = 4
"""Number of data input, data output and control bits."""

OperationList = Literal["paper", "published_code"]
MultiplexerReading = Literal["paper", "published_code"]


MULTIPLEXER = Operation("multiplexer", 3, 1, lambda x: (x[1] if x[0] else x[2],))
# The published code reads the select bit from the inactive fourth bit, which is always 0: the output is always the
# middle active bit.
MULTIPLEXER_AS_PUBLISHED = Operation("multiplexer", 3, 1, lambda x: (x[1],))
NAND = Operation("nand", 2, 1, lambda x: (1 - (x[0] & x[1]),))
NOT = Operation("not", 1, 1, lambda x: (1 - x[0],))
AND = Operation("and", 2, 1, lambda x: (x[0] & x[1],))
XOR = Operation("xor", 2, 1, lambda x: (x[0] ^ x[1],))
XAX = Operation("xax", 3, 1, lambda x: ((x[0] ^ x[1]) & (x[1] ^ x[2]),))
INCREMENT = Operation("increment", WIDTH, WIDTH, lambda x: bits_of((number_of(x) + 1) % 2**WIDTH, WIDTH))
DECREMENT = Operation("decrement", WIDTH, WIDTH, lambda x: bits_of((number_of(x) - 1) % 2**WIDTH, WIDTH))
SHIFT_LEFT = Operation("shift left", WIDTH, WIDTH, lambda x: (*x[1:], 0))
SHIFT_RIGHT = Operation("shift right", WIDTH, WIDTH, lambda x: (0, *x[:-1]))

OPERATIONS: dict[OperationList, tuple[Operation, ...]] = {
    "paper": (MULTIPLEXER, NAND, NOT, AND, XOR, INCREMENT, DECREMENT, SHIFT_LEFT, SHIFT_RIGHT),
    "published_code": (MULTIPLEXER, NAND, NOT, AND, XOR, XAX, INCREMENT, DECREMENT, SHIFT_LEFT),
}


@dataclass(frozen=True)
class SimpleAlu(Circuit):
    """Level k asks for operations 0 … k together.

    An observation is the operation's index in 4 bits, most significant first, then 4 data bits. An operation with i
    inputs uses the last i of them (the others are 0); one with o outputs is scored on the first o of 4.

    Attributes:
        level_count: how many of the nine operations to ask for, from 1.
        operations: the paper's list, or the published code's, with XAX and without shift right.
        multiplexer: the paper's, or the published code's, whose select bit is always 0.
        sampling: see `Circuit`.
    """

    name: ClassVar[str] = "simple_alu"
    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ()

    level_count: int = 9
    operations: OperationList = "paper"
    multiplexer: MultiplexerReading = "paper"
    sampling: Sampling = "exhaustive"

    def __post_init__(self) -> None:
        """Check the sizes and names."""
        require_known("operation list", self.operations, OPERATIONS)
        require_known("multiplexer reading", self.multiplexer, get_args(MultiplexerReading))
        if not 1 <= self.level_count <= len(OPERATIONS[self.operations]):
            raise UserError(
                f"Simple ALU has level_count={self.level_count}. Write a number from 1 to "
                f"{len(OPERATIONS[self.operations])}."
            )
        super().__post_init__()

    @cached_property
    def operation_list(self) -> tuple[Operation, ...]:
        """The operations asked for, in level order."""
        operations = OPERATIONS[self.operations][: self.level_count]
        if self.multiplexer == "published_code":
            return (MULTIPLEXER_AS_PUBLISHED, *operations[1:])
        return operations

    @cached_property
    def table(self) -> TruthTable:
        """The operations' tables in order, so that a level is a prefix."""
        inputs, targets, active, rows_at_level = [], [], [], []
        for index, operation in enumerate(self.operation_list):
            for number in range(2**operation.inputs):
                data = bits_of(number, operation.inputs)
                unused = (0,) * (WIDTH - operation.outputs)
                inputs.append((*bits_of(index, WIDTH), *(0,) * (WIDTH - operation.inputs), *data))
                targets.append((*operation.compute(data), *unused))
                active.append((1,) * operation.outputs + unused)
            rows_at_level.append(len(inputs))
        return TruthTable(
            inputs=np.array(inputs, dtype=np.float32),
            targets=np.array(targets, dtype=bool),
            active=np.array(active, dtype=bool),
            rows_at_level=tuple(rows_at_level),
        )
