"""A GPU for tests: executes the PTX that kernels are written in, all threads in step, with NumPy."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Sequence
from typing import Any

import jax
import numpy as np
import pytest
from numpy.typing import NDArray

from evoclaims.envs.ecorobot import robot_task
from evoclaims.kernels import one_kernel

INSTRUCTION = re.compile(r"(?:@(?P<when>%\w+) )?(?P<code>[\w.]+)(?: (?P<operands>.*))?")
# fmt: off
CODES = frozenset({
    "abs.f32", "abs.s32", "add.f32", "add.s32", "and.b32", "and.pred", "cvt.rmi.f32.f32", "cvt.rn.f32.s32",
    "cvt.rni.f32.f32", "cvt.rpi.f32.f32", "cvt.rzi.s32.f32", "cvta.to.global.u64", "div.rn.f32", "div.s32",
    "div.u32", "ld.global.f32", "ld.global.s32", "ld.global.u8", "ld.param.u64", "mad.lo.u32", "mad.wide.u32",
    "max.NaN.f32", "max.s32", "min.NaN.f32", "min.s32", "mov.f32", "mov.pred", "mov.s32", "mov.u32", "mul.f32",
    "mul.lo.s32", "neg.f32", "neg.s32", "not.b32", "not.pred", "or.b32", "or.pred", "rem.s32", "selp.f32",
    "selp.s32", "setp.eq.f32", "setp.eq.s32", "setp.ge.f32", "setp.ge.s32", "setp.ge.u32", "setp.gt.f32",
    "setp.gt.s32", "setp.le.f32", "setp.le.s32", "setp.lt.f32", "setp.lt.s32", "setp.ne.s32", "setp.neu.f32",
    "sqrt.rn.f32", "sub.f32", "sub.s32", "xor.b32", "xor.pred",
})
# fmt: on
"""The instructions that there are (PTX ISA 7.1), of those that kernels use."""
WRITES = {"f32": "f", "s32": "r", "b32": "r", "pred": "pn"}
"""First letters of the registers that instructions of a type write; %none is a predicate, too."""
BINARY = {
    "add": np.add,
    "and": np.bitwise_and,
    "max": np.maximum,
    "min": np.minimum,
    "mul": np.multiply,
    "or": np.bitwise_or,
    "sub": np.subtract,
    "xor": np.bitwise_xor,
    "eq": np.equal,
    "ge": np.greater_equal,
    "gt": np.greater,
    "le": np.less_equal,
    "lt": np.less,
    "ne": np.not_equal,
    "neu": np.not_equal,
}
UNARY = {"abs": np.abs, "neg": np.negative, "not": np.invert, "sqrt": np.sqrt}
ROUNDED = {"rmi": np.floor, "rni": np.rint, "rpi": np.ceil, "rzi": np.trunc}


def execute(ptx: str, operands: Sequence[NDArray[Any]], results: Sequence[NDArray[Any]], block: int) -> None:
    """Run a kernel of as many threads as the results have rows, and write into `results`.

    Raises:
        AssertionError: when an instruction is unknown, a register undeclared or of another kind, or a row out of an
            array's bounds.
    """
    header, body = ptx.split("\n{\n")
    parameters = dict(zip(re.findall(r"\.param \.u64 (\w+)", header), [*operands, *results], strict=True))
    assert f".maxntid {block}, 1, 1" in header
    machine = _Machine(parameters, len(results[0]), block)
    lines = [line.removesuffix(";") for line in body.split("\n")]
    labels = {line[:-1]: number for number, line in enumerate(lines) if line.endswith(":")}
    at = 0
    while lines[at] != "ret":
        target = None if lines[at].endswith(":") else machine.step(lines[at])
        at = labels[target] if target else at + 1


@pytest.fixture
def gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have kernels run on this machine."""
    for module in (one_kernel, robot_task):
        monkeypatch.setattr(module, "has_gpu", lambda: True)
    monkeypatch.setattr(jax.lax, "platform_dependent", lambda *operands, cuda, default: cuda(*operands))
    monkeypatch.setattr(jax.ffi, "ffi_call", ffi_call)


def ffi_call(target: str, shapes: Sequence[jax.ShapeDtypeStruct]) -> Callable[..., Any]:
    """Stand in for `jax.ffi.ffi_call`: execute the kernel that XLA would launch."""

    def launch(*operands: Any, kernel_data: str, grid_x: Any, block_x: Any, **attributes: Any) -> Any:
        assert target == "__gpu$xla.gpu.ptx"
        assert {attributes.pop(name) for name in ("grid_y", "grid_z", "block_y", "block_z")} == {1}
        assert attributes == {"name": "kernel", "kernel_type": "ptx", "shared_mem_bytes": 0}
        assert grid_x == -(-shapes[0].shape[0] // block_x), "threads and rows"

        def run(*operands: Any) -> list[Any]:
            results = [np.full(s.shape, -77, s.dtype) for s in shapes]
            execute(kernel_data, [np.asarray(o) for o in operands], results, int(block_x))
            return results

        return jax.pure_callback(run, list(shapes), *operands)

    return launch


class _Machine:
    """Registers of all threads of all blocks, as arrays."""

    def __init__(self, parameters: dict[str, NDArray[Any]], threads: int, block: int) -> None:
        """Start; the last block has threads without a row."""
        started = -(-threads // block) * block
        self.threads, self.block, self.started = threads, block, started
        self.parameters = parameters
        self.registers: dict[str, Any] = {}
        self.declared: set[str] = set()

    def step(self, line: str) -> str | None:
        """Execute an instruction; return where to go on, if not at the next one."""
        if line.startswith(".reg"):
            for name in line.split(" ", 2)[2].split(", "):
                stem, _, count = name.rstrip(">").partition("<")
                self.declared |= {f"{stem}{i}" for i in range(int(count))} if count else {stem}
            return None
        match = INSTRUCTION.fullmatch(line)
        assert match, line
        code, operands = match["code"].split("."), match["operands"].split(", ")
        if code[0] == "bra":
            taken = self.registers[match["when"]]
            if operands[0] == "done":  # threads without a row end here
                assert np.array_equal(taken, np.arange(self.started) >= self.threads)
                return None
            assert np.all(taken == taken[0]), "threads part"
            return operands[0] if taken[0] else None
        assert not match["when"]
        if code[:2] == ["st", "global"]:
            self._store(operands[0], self._value(operands[1], code[-1]))
            return None
        assert operands[0] in self.declared, operands[0]
        assert match["code"] in CODES, f"no instruction: {match['code']}"
        kind = "pred" if code[0] == "setp" else code[2 if code[0] == "cvt" else -1].replace("u8", "s32")
        assert operands[0][1] in WRITES.get(kind, operands[0]), f"{line} writes another kind of register"
        with np.errstate(all="ignore"):
            self.registers[operands[0]] = self._compute(code, operands[1:])
        return None

    def _value(self, name: str, kind: str) -> Any:
        """Return an operand's value in all threads."""
        if name == "%ctaid.x":
            return np.arange(self.started) // self.block
        if name == "%tid.x":
            return np.arange(self.started) % self.block
        if name.startswith("%"):
            value = self.registers[name]
            expected = {"f32": np.float32, "s32": np.int32, "b32": np.int32, "pred": bool}.get(kind)
            assert expected is None or value.dtype == expected, (name, value.dtype, kind)
            return value
        if name.startswith("0f"):
            return np.full(self.started, struct.unpack(">f", bytes.fromhex(name[2:]))[0], np.float32)
        return np.full(self.started, int(name), np.int32)

    def _compute(self, code: list[str], operands: list[str]) -> Any:
        """Return an instruction's result in all threads."""
        kind = code[-1]
        match code:
            case ["ld", "param", "u64"]:
                array = self.parameters[operands[0].strip("[]")]
                return (array, np.zeros(self.started, np.int64))
            case ["cvta", *_]:
                return self.registers[operands[0]]
            case ["mad", "lo", "u32"]:
                a, b, c = (self._value(o, "u32") for o in operands)
                return a * b + c
            case ["div", "u32"]:
                return self._value(operands[0], "u32") // int(operands[1])
            case ["mad", "wide", "u32"]:
                array, offset = self.registers[operands[2]]
                return (array, offset + self._value(operands[0], "u32") * int(operands[1]))
            case ["ld", "global", _]:
                return self._load(operands[0], kind)
            case ["mov", _]:
                return self._value(operands[0], kind)
            case ["selp", _]:
                yes, no = (self._value(o, kind) for o in operands[:2])
                return np.where(self._value(operands[2], "pred"), yes, no)
            case ["setp", name, "u32"]:
                return BINARY[name](*(self._value(o, kind) for o in operands))
            case ["cvt", "rn", "f32", "s32"]:
                return self._value(operands[0], "s32").astype(np.float32)
            case ["cvt", "rzi", "s32", "f32"]:
                value = np.nan_to_num(self._value(operands[0], "f32").astype(np.float64), nan=0.0)
                return np.clip(np.trunc(value), -(2.0**31), 2.0**31 - 1).astype(np.int32)
            case ["cvt", rounding, "f32", "f32"]:
                return ROUNDED[rounding](self._value(operands[0], "f32"))
            case ["div", "rn", "f32"]:
                return np.divide(*(self._value(o, kind) for o in operands))
            case ["div", "s32"]:
                return np.trunc(np.divide(*(self._value(o, kind) for o in operands))).astype(np.int32)
            case ["rem", "s32"]:
                return np.fmod(*(self._value(o, kind) for o in operands))
        names = [c for c in code[:-1] if c not in ("setp", "lo", "rn", "NaN")]
        assert len(names) == 1, code
        assert names[0] not in ("max", "min") or "NaN" in code or kind == "s32", code
        values = [self._value(o, kind) for o in operands]
        return (UNARY[names[0]] if names[0] in UNARY else BINARY[names[0]])(*values)

    def _place(self, address: str) -> tuple[NDArray[Any], Any]:
        """Return an array, and which of its numbers each thread with a row means."""
        register, offset = address.strip("[]").split("+")
        array, start = self.registers[register]
        places, rest = np.divmod(start[: self.threads] + int(offset), array.itemsize)
        assert not rest.any(), address
        assert places.max() < array.size, address
        return array.reshape(-1), places

    def _load(self, address: str, kind: str) -> Any:
        """Read memory; threads without a row read the last one's."""
        array, places = self._place(address)
        assert array.dtype == {"f32": np.float32, "s32": np.int32, "u8": bool}[kind]
        values = array[np.concatenate([places, np.full(self.started - self.threads, places[-1])])]
        return values.astype(np.int32) if kind == "u8" else values

    def _store(self, address: str, values: Any) -> None:
        """Write memory."""
        array, places = self._place(address)
        array[places] = values[: self.threads]
