"""Instructions for NVIDIA's GPUs, with quotients and square roots that have no branches, except in the longest kernels.

NVIDIA's assembler makes a branch and a call of an exactly rounded division or root, and moves nothing across them. Here
both are made of a GPU's approximation and of remainders, which a fused multiply-add computes exactly (P. Markstein,
"Computation of elementary functions on the IBM RISC System/6000 processor", 1990): with a reciprocal right to half a
unit (or a hair more), and a quotient right to one, the quotient plus its remainder times the reciprocal is rounded as
IEEE 754 says.

An approximation may be wrong by 2 units in the last place. Results have the bits of IEEE's, also for zeros of both
signs, infinities and NaN, except that

* a quotient of a dividend below 2^-102 may be wrong by a unit, and of one below 2^-122 by 5, since its remainder is not
  exact;
* so may a denormal quotient by a unit, where the exact one lies in the middle of two numbers, or below 2^-149;
* so may one by a divisor above 2^126 by a unit, since its reciprocal is denormal, and by one of the few largest be 0;
* a divisor below 2^-128, whose reciprocal is infinite, counts as 0, and 2^-128 itself may; and
* a quotient that is one of the few largest numbers may be infinite.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from evoclaims.kernels.emit.llvm_ir import Instructions, literal, of_literal
from evoclaims.kernels.trace.expressions import Number

SCALE: Final = np.float32(4)
"""Divisors up to 1 are multiplied by this, others divided: so neither they nor their reciprocals are denormal."""
UPWARD: Final = np.float32(2**-43)
"""More than the square of an approximation's relative error, by which a step of Newton's makes a reciprocal too small.

Reciprocals of numbers just below a power of two are just above the middle of two numbers, and have to be rounded up.
"""
SMALL_SQUARE: Final = np.float32(2**-60)
"""The remainders of roots of smaller numbers may be denormal, so that these are scaled."""
GROWN: Final = np.float32(2**64)
"""By so much; the root shrinks by the root of it."""
SHRUNK: Final = np.float32(2**-32)


@dataclass(frozen=True)
class _Divisor:
    """What all quotients by a number need: registers or literals.

    Attributes:
        rough: the approximate reciprocal; of 0 and infinity it is right.
        reciprocal: one that is right to half a unit; NaN for 0 and infinity.
    """

    rough: str
    reciprocal: str


class GpuInstructions(Instructions):
    """Instructions of a thread. Quotients by one number share its reciprocal, as far as a basic block goes."""

    def __init__(self, branches: bool = False) -> None:
        """Start empty; with `branches`, quotients and roots are those of NVIDIA's assembler."""
        super().__init__(1)
        self._with_branches = branches
        self._divisors: dict[str, _Divisor] = {}

    def label(self, name: str) -> None:
        """Begin a basic block."""
        super().label(name)
        self._divisors.clear()  # what another block has computed may not be at hand in this one

    def divided(self, dividend: str, divisor: str) -> str:
        """Write a quotient of two floats; return its register."""
        if self._with_branches:
            return super().divided(dividend, divisor)
        if divisor not in self._divisors:
            self._divisors[divisor] = self._divisor(divisor)
        by = self._divisors[divisor]
        rough = self._product(dividend, by.rough)
        quotient = rough
        for _ in range(2):
            excess = self._fma(divisor, quotient, self._negative(dividend))
            quotient = self._fma(self._negative(excess), by.reciprocal, quotient)
        return self._corrected(quotient, rough)

    def _divisor(self, divisor: str) -> _Divisor:
        """Write what all quotients by a number need."""
        if divisor.startswith("0x"):
            known = np.float32(of_literal(divisor))
            if 2.0**-126 <= abs(known) <= 2.0**126:
                reciprocal = literal(np.float32(1) / known)
                return _Divisor(reciprocal, reciprocal)
        one = literal(np.float32(1))
        large = self.put(f"fcmp ogt float {self._size(divisor)}, {one}")
        scale = self._either(large, 1 / SCALE, SCALE)
        rough = self._product(self._approximate("rcp", self._product(divisor, scale)), scale)
        missing = self._fma(self._negative(divisor), rough, one)
        missing = self.put(f"fadd float {missing}, {literal(UPWARD)}")
        return _Divisor(rough, self._fma(rough, missing, rough))

    def root(self, number: str) -> str:
        """Write a square root of a float; return its register."""
        if self._with_branches:
            return super().root(number)
        half = literal(np.float32(0.5))
        small = self.put(f"fcmp olt float {number}, {literal(SMALL_SQUARE)}")
        x = self._product(number, self._either(small, GROWN, np.float32(1)))
        reciprocal = self._approximate("rsqrt", x)
        root, slope = self._product(x, reciprocal), self._product(reciprocal, half)
        missing = self._fma(self._negative(slope), root, half)
        root, slope = self._fma(root, missing, root), self._fma(slope, missing, slope)  # the root is not too large now
        left = self._fma(self._negative(root), root, x)
        root = self._corrected(self._fma(left, slope, root), self._approximate("sqrt", x))
        return self._product(root, self._either(small, SHRUNK, np.float32(1)))

    def in_any_lane(self, condition: str) -> str:
        """Return whether a condition is true in any thread of the warp, which would else execute both ways in turn."""
        return self.call("llvm.nvvm.vote.any.sync", "i1", [("i32", "-1"), ("i1", condition)])

    def _either(self, condition: str, yes: Number, no: Number) -> str:
        return self.put(f"select i1 {condition}, float {literal(yes)}, float {literal(no)}")

    def _corrected(self, value: str, rough: str) -> str:
        """Write a choice: corrections lose a zero's sign, and make NaN of infinities, which are right without."""
        usual = self.put(f"fcmp ogt float {self._size(value)}, {literal(np.float32(0))}")
        return self.put(f"select i1 {usual}, float {value}, float {rough}")

    def _size(self, value: str) -> str:
        return self.call("llvm.fabs.f32", "float", [("float", value)])

    def _approximate(self, name: str, x: str) -> str:
        return self.call(f"llvm.nvvm.{name}.approx.ftz.f", "float", [("float", x)])

    def _product(self, a: str, b: str) -> str:
        return self.put(f"fmul float {a}, {b}")

    def _negative(self, a: str) -> str:
        return self.put(f"fneg float {a}")

    def _fma(self, a: str, b: str, c: str) -> str:
        return self.call("llvm.fma.f32", "float", [("float", a), ("float", b), ("float", c)])
