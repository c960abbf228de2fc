"""Runs the text of a GPU's kernel on this processor: threads that wait for each other are threads, with real barriers.

Where warps share the work a lane is run at a time, a thread for each warp; where threads compute an element's parts, an
element at a time; where a block plays episodes, a block.
"""

from __future__ import annotations

import ctypes
import re
import threading
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from approximations import on_a_processor

from evoclaims.kernels.emit import machine_code
from evoclaims.kernels.emit.block_kernel import BlockShape
from evoclaims.kernels.emit.gpu_kernel import BLOCK, ENTRY, GpuProgram

NOT_A_NUMBER = 0x7FC00000
CALLED = ctypes.CFUNCTYPE(None)
ASKED = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_int32)
SHUFFLED = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_int32, ctypes.c_int32)


def run(
    text: str, shape: BlockShape | GpuProgram, rows: int, arrays: Sequence[Any], results: Sequence[Any]
) -> list[Any]:
    """Return a kernel's results.

    Args:
        text: LLVM's text of the kernel, for a GPU.
        shape: of its blocks.
        rows: elements of the batch.
        arrays: those that it reads.
        results: shapes of what it computes.
    """
    kernel, made = _compiled(_for_this_processor(text), arrays, results)
    for first in range(0, rows, BLOCK * shape.teams):
        for lane in range(BLOCK):
            memory = np.full(shape.shared_bytes // 4, NOT_A_NUMBER, np.int32)
            barrier = threading.Barrier(shape.warps * shape.teams)
            wait = CALLED(lambda barrier=barrier: barrier.wait(60) and None)
            anyone = ASKED(partial(_anyone, barrier, {}))
            block = first // (BLOCK * shape.teams)
            places = [(block, lane, warp, team) for warp in range(shape.warps) for team in range(shape.teams)]
            given = [(memory.ctypes.data, *place, wait, anyone) for place in places]
            _at_once(kernel, given)
            of_others = np.delete(memory.reshape(-1, BLOCK), lane, axis=1)
            assert (of_others == NOT_A_NUMBER).all(), "a lane wrote into another's words"
    return made


def run_parts(text: str, parts: int, rows: int, arrays: Sequence[Any], results: Sequence[Any]) -> list[Any]:
    """Return the results of a kernel of `part_kernel`; for the rest see `run`."""
    text = re.sub(
        r"(%\w+) = call i1 @llvm.nvvm.vote.any.sync\(i32 -1, i1 (%?\w+)\)",
        r"\1.in = zext i1 \2 to i32\n\1.out = call i32 %anyone(i32 \1.in)\n\1 = icmp ne i32 \1.out, 0",
        text,
    )
    for mode in ("idx", "bfly"):
        call = rf"call i32 @llvm.nvvm.shfl.sync.{mode}.i32\(i32 -1, (i32 %\w+), (i32 \d+), i32 \d+\)"
        text = re.sub(call, rf"call i32 %{mode}(\1, \2)", text)
        call = rf"(%\w+) = call float @llvm.nvvm.shfl.sync.{mode}.f32\(i32 -1, float (%\w+), (i32 \d+), i32 \d+\)"
        called = rf"\1.in = bitcast float \2 to i32\n\1.out = call i32 %{mode}(i32 \1.in, \3)"
        text = re.sub(call, rf"{called}\n\1 = bitcast i32 \1.out to float", text)
    text = _for_this_processor(text).replace("ptr %anyone)", "ptr %anyone, ptr %idx, ptr %bfly)")
    kernel, made = _compiled(text, arrays, results, SHUFFLED, SHUFFLED)
    for element in range(-(-rows * parts // BLOCK) * BLOCK // parts):  # those of the last block compute the last one
        barrier, numbers, votes = threading.Barrier(parts), [0] * parts, dict[int, int]()

        def shuffle(own: int, number: int, of: int, barrier: Any = barrier, numbers: Any = numbers) -> int:
            numbers[own] = number
            barrier.wait(60)
            shuffled: int = numbers[of]
            barrier.wait(60)
            return shuffled

        anyone, nothing = ASKED(partial(_anyone, barrier, votes)), CALLED(lambda: None)
        given = []
        for part in range(parts):
            asked = (
                SHUFFLED(partial(shuffle, part)),
                SHUFFLED(lambda number, bit, part=part, shuffle=shuffle: shuffle(part, number, part ^ bit)),
            )
            block, lane = divmod(element * parts + part, BLOCK)
            given.append((0, block, lane, 0, 0, nothing, anyone, *asked))
        _at_once(kernel, given)
    return made


def run_episodes(text: str, program: GpuProgram, rows: int, arrays: Sequence[Any], results: Sequence[Any]) -> list[Any]:
    """Return the results of a kernel of `episode_kernel`, a block at a time; for the rest see `run`."""
    text = text.replace("call void @llvm.nvvm.bar.warp.sync(i32 -1)", "call void %warp_waits()")
    text = _for_this_processor(text).replace("ptr %anyone)", "ptr %anyone, ptr %warp_waits)")
    kernel, made = _compiled(text, arrays, results, CALLED)
    nobody = ASKED(lambda _: 0)
    for block in range(-(-rows // program.elements)):
        memory = np.full(program.shared_bytes // 4, NOT_A_NUMBER, np.int32)
        barriers = [threading.Barrier(BLOCK * program.warps), *(threading.Barrier(BLOCK) for _ in range(program.warps))]
        wait, *of_warps = [CALLED(lambda barrier=barrier: barrier.wait(60) and None) for barrier in barriers]
        places = [(block, lane, warp, 0) for warp in range(program.warps) for lane in range(BLOCK)]
        given = [(memory.ctypes.data, *place, wait, nobody, of_warps[place[2]]) for place in places]
        _at_once(kernel, given)
    return made


def _compiled(
    text: str, arrays: Sequence[Any], results: Sequence[Any], *more: Any
) -> tuple[Callable[..., None], list[Any]]:
    """Return a kernel that takes what follows its arrays (`more` are types), and where its results will be."""
    read = [np.ascontiguousarray(a) for a in arrays]
    made = [np.full(r.shape, 77, r.dtype) for r in results]
    addresses = [ctypes.c_void_p(a.ctypes.data) for a in (*read, *made)]
    types = [*[ctypes.c_void_p] * (len(addresses) + 1), *[ctypes.c_int32] * 4, CALLED, ASKED, *more]
    kernel = ctypes.CFUNCTYPE(None, *types)(machine_code.address(text, ENTRY))

    def call(*given: Any, arrays: Any = read) -> None:  # they must live as long as the kernel
        kernel(*addresses, *given)

    return call, made


def _at_once(kernel: Callable[..., None], given: Sequence[Sequence[Any]]) -> None:
    """Call a kernel with each of the arguments, all at once."""
    threads = [threading.Thread(target=kernel, args=arguments) for arguments in given]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def _anyone(barrier: threading.Barrier, votes: dict[int, int], vote: int) -> int:
    """Wait for all warps; return whether the vote of any is not 0."""
    votes[threading.get_ident()] = vote
    barrier.wait(60)
    result = any(votes.values())
    barrier.wait(60)
    return int(result)


def _for_this_processor(text: str) -> str:
    """Replace what only a GPU has by parameters: shared memory, where a thread is, and the barrier."""
    text = on_a_processor(text, units=1)
    text = re.sub(r" ?addrspace\(\d\)", "", text.replace("ptx_kernel ", ""))
    text = "\n".join(line for line in text.splitlines() if not line.startswith("declare") or "nvvm" not in line)
    text = re.sub(r"target triple.*|@numbers = .*", "", text).replace("ptr @numbers", "ptr %numbers")
    text = text.replace("addrspacecast ", "bitcast ")
    for register, name in (("ctaid.x", "block"), ("tid.x", "lane"), ("tid.y", "warp"), ("tid.z", "team")):
        text = text.replace(f"call i32 @llvm.nvvm.read.ptx.sreg.{register}()", f"add i32 %{name}, 0")
    text = re.sub(r"call i32 @llvm.nvvm.shfl.sync.idx.i32\(i32 -1, (i32 %\w+),.*", r"add \1, 0", text)
    text = text.replace("call void @llvm.nvvm.barrier0()", "call void %wait()")
    text = re.sub(r"call i1 @llvm.nvvm.vote.any.sync\(i32 -1, i1 (%?\w+)\)", r"or i1 \1, false", text)
    text = text.replace("call i32 @llvm.nvvm.barrier0.or(", "call i32 %anyone(")
    given = "ptr %numbers, i32 %block, i32 %lane, i32 %warp, i32 %team, ptr %wait, ptr %anyone"
    return re.sub(r"(define void @\w+\(.*?)\)", rf"\1, {given})", text)
