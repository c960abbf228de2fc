"""What the gates should answer, worked out with Python's integers alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from evoclaims.envs.base import PolicyFn
from evoclaims.envs.gates.alu import SimpleAlu
from evoclaims.envs.gates.parity import NParity

OPERATIONS: dict[str, tuple[int, int, Callable[[int], int]]] = {
    "multiplexer": (3, 1, lambda d: (d // 2 if d >= 4 else d) % 2),
    "multiplexer_as_published": (3, 1, lambda d: d // 2 % 2),
    "nand": (2, 1, lambda d: int(d != 3)),
    "not": (1, 1, lambda d: 1 - d),
    "and": (2, 1, lambda d: d // 3),
    "xor": (2, 1, lambda d: int(d in {1, 2})),
    "xax": (3, 1, lambda d: int(d in {2, 5})),  # neighbours that differ twice: 010 and 101
    "increment": (4, 4, lambda d: (d + 1) % 16),
    "decrement": (4, 4, lambda d: (d + 15) % 16),
    "shift left": (4, 4, lambda d: d * 2 % 16),
    "shift right": (4, 4, lambda d: d // 2),
}
"""Inputs, outputs, and the outputs' number as a function of the inputs' number."""
PAPER = "multiplexer nand not and xor increment decrement shift_left shift_right"
PUBLISHED = "multiplexer nand not and xor xax increment decrement shift_left"


@dataclass(frozen=True)
class Line:
    """One row of a truth table: the bits shown, and the bits wanted, None where the output is not scored."""

    shown: tuple[int, ...]
    wanted: tuple[int | None, ...]


def parity_lines(bits: int, level: int) -> list[Line]:
    return [Line(_bits(n, bits), (n.bit_count() % 2,)) for n in range(2 ** (level + 2))]


def alu_lines(names: str, level: int, published_multiplexer: bool) -> list[Line]:
    lines = []
    for index, name in enumerate(names.split()):
        key = name.replace("_", " ")
        if key == "multiplexer" and published_multiplexer:
            key = "multiplexer_as_published"
        inputs, outputs, compute = OPERATIONS[key]
        if index <= level:
            for data in range(2**inputs):
                answer: tuple[int | None, ...] = _bits(compute(data), outputs)
                lines.append(Line(_bits(index, 4) + _bits(data, 4), answer + (None,) * (4 - outputs)))
    return lines


def _bits(number: int, width: int) -> tuple[int, ...]:
    return tuple(map(int, format(number, f"0{width}b")))


@dataclass(frozen=True)
class Gate:
    """A gate task and what each of its levels should ask."""

    task: Any
    lines: Callable[[int], list[Line]]

    @property
    def last(self) -> list[Line]:
        return self.lines(self.task.levels - 1)


def _gates() -> Iterator[tuple[str, Gate]]:
    for bits in range(2, 9):
        yield f"parity of {bits}", Gate(NParity(bits), lambda level, bits=bits: parity_lines(bits, level))
    for operations, names in (("paper", PAPER), ("published_code", PUBLISHED)):
        for multiplexer in ("paper", "published_code"):
            yield (
                f"ALU, list of {operations}, multiplexer of {multiplexer}",
                Gate(
                    SimpleAlu(operations=operations, multiplexer=multiplexer),
                    lambda level, names=names, as_published=multiplexer != "paper": alu_lines(
                        names, level, as_published
                    ),
                ),
            )


GATES: dict[str, Gate] = dict(_gates())


def table_policy(inputs: NDArray[np.float32], answers: Any) -> PolicyFn:
    """Return a policy that looks its answer up, by inputs [lines, inputs] and answers [lines, outputs]."""
    shown, looked_up = jnp.asarray(inputs), jnp.asarray(answers, jnp.float32)
    return lambda observation: looked_up[jnp.argmax(jnp.all(shown == observation[None], axis=-1))]


def right_answers(lines: list[Line], unscored: float = 0.0) -> NDArray[np.float64]:
    """Return ±1 for wanted bits and `unscored` where an output is not scored, shape [lines, outputs]."""
    return np.array([[unscored if bit is None else 2.0 * bit - 1.0 for bit in line.wanted] for line in lines])


def every_level(task: Any) -> jax.Array:
    return jnp.arange(task.levels, dtype=jnp.int32)
