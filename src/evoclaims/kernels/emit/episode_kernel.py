"""A kernel for NVIDIA's GPUs that plays whole episodes: a step after the other, with the perceptron that acts.

A block plays a few episodes. In its first warp each lane computes the steps of one, whose state stays in registers; the
other warps compute the actions, a lane a neuron, from parameters in the block's memory. So the code of a step, which is
long, is fetched from nearby after the first, and nothing of an episode is written before it ends.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Final

import jax
import jax.numpy as jnp
import numpy as np

from evoclaims.kernels.emit.control import repeat
from evoclaims.kernels.emit.gpu_instructions import GpuInstructions
from evoclaims.kernels.emit.gpu_kernel import BLOCK, Element, finished, parameters
from evoclaims.kernels.emit.llvm_ir import BYTES, TYPES, ArrayRow
from evoclaims.kernels.trace.expressions import Input, in_order
from evoclaims.kernels.trace.interpreter import Numbers
from evoclaims.kernels.trace.scalarize import scalarize

ACTING: Final = 4
"""Most warps of a block that compute actions: with more, each has too few registers."""
SOURCES: Final = ("ctaid.x", "tid.x", "tid.y")
FLOAT: Final = np.dtype(np.float32)
QUAD: Final = 4
"""Numbers that are read at once."""
SHARED: Final = f"@numbers = external addrspace(3) global [0 x i32], align {4 * QUAD}\n"


@dataclass(frozen=True)
class Layer:
    """A dense layer of a perceptron.

    Attributes:
        inputs, width: its numbers of inputs and neurons.
        start: where its weights begin in the parameters, [width, inputs]; the biases follow.
        at: where they begin in the block's memory.
    """

    inputs: int
    width: int
    start: int
    at: int

    @property
    def stride(self) -> int:
        """Numbers from one neuron's weights to the next's: an odd number of quads, so that lanes use all banks."""
        quads = -(-self.inputs // QUAD)
        return QUAD * (quads + 1 - quads % 2)

    @property
    def biases(self) -> int:
        """Where its biases begin in the block's memory."""
        return self.at + self.width * self.stride

    @property
    def end(self) -> int:
        """Where the next layer's weights begin there."""
        return self.biases + _rounded_up(self.width, QUAD)


@dataclass(frozen=True)
class Perceptron:
    """Dense tanh layers.

    Attributes:
        widths: of the observation, of each layer, of the action.
    """

    widths: tuple[int, ...]

    @property
    def layers(self) -> list[Layer]:
        """Its layers."""
        made: list[Layer] = []
        start = at = 0
        for inputs, width in pairwise(self.widths):
            made.append(Layer(inputs, width, start, at))
            start, at = start + (inputs + 1) * width, made[-1].end
        return made

    @property
    def size(self) -> int:
        """Its parameters."""
        return sum((layer.inputs + 1) * layer.width for layer in self.layers)

    @property
    def room(self) -> int:
        """Words of the block's memory for what a layer gets or makes."""
        return _rounded_up(max(self.widths), BLOCK)

    @property
    def words(self) -> int:
        """The block's memory for one episode: parameters, what is observed, and what layers make in turns."""
        return self.layers[-1].end + 3 * self.room


@dataclass(frozen=True)
class Play:
    """An episode.

    Attributes:
        steps: how many.
        state: the expressions of the state after a step, array by array. Their first inputs are the arrays of the state
            before, then comes the action, and then what no step changes.
        network: the perceptron, which sees the first array. Its parameters are the kernel's argument in place of the
            action.
    """

    steps: int
    state: Sequence[Numbers]
    network: Perceptron

    @property
    def written(self) -> list[int]:
        """The arrays of the state that are not empty: the kernel's results."""
        return [array for array, numbers in enumerate(self.state) if numbers.size]


def episodes_of_a_block(network: Perceptron, rows: int, processors: int, memory: int) -> int:
    """Return how many episodes a block plays, so that all processors are used: a power of 2; 0 if they do not fit."""
    count = 1 << (-(-rows // processors) - 1).bit_length()
    return count if count <= BLOCK and count * network.words * BYTES["f"] <= memory else 0


def text(play: Play, arrays: Mapping[int, ArrayRow], shared: Mapping[int, int], rows: int, together: int) -> str:
    """Return LLVM's text of a kernel, as `gpu_kernel.text` does.

    Its results are all arrays of the state. Lanes without an episode of their own play that of another, and store
    nothing.

    Args:
        play: the episode.
        arrays: the rows of the arrays read, in order.
        shared: how many consecutive episodes share a row of each.
        rows: episodes.
        together: how many a block plays.
    """
    page = GpuInstructions()
    page.label("entry")
    block, lane, warp = (page.call(f"llvm.nvvm.read.ptx.sreg.{name}", "i32", []) for name in SOURCES)
    first = page.put(f"mul i32 {block}, {together}")
    at_once = _Block(play, page, lane, together)
    at_once.copy_parameters(warp, lambda own: Element(page, _row(page, first, own, rows), arrays, shared))
    at_once.wait()
    first_lane = [("i32", "-1"), ("i32", warp), ("i32", "0"), ("i32", "31")]
    warp = page.call("llvm.nvvm.shfl.sync.idx.i32", "i32", first_lane)  # so the assembler knows that lanes go together
    page.write(f"br i1 {page.put(f'icmp eq i32 {warp}, 0')}, label %stepping, label %acting")
    page.label("acting")
    at_once.act(warp)
    page.label("stepping")
    own = page.call("llvm.umin.i32", "i32", [("i32", lane), ("i32", str(together - 1))])
    number = page.put(f"add i32 {first}, {lane}")
    mine, exists = (page.put(f"icmp ult i32 {n}, {below}") for n, below in ((lane, together), (number, rows)))
    inside = page.put(f"and i1 {mine}, {exists}")
    at_once.step(own, Element(page, _row(page, first, own, rows), arrays, shared), inside)
    return finished(page, parameters(arrays, len(play.written)), warps_for(together)) + SHARED


def warps_for(together: int) -> int:
    """Return the warps of a block that plays so many episodes."""
    return 1 + min(together, ACTING)


def _row(page: GpuInstructions, first: str, own: str, rows: int) -> str:
    """Return the number of an episode of the block: the last one's for those that do not exist."""
    number = page.put(f"add i32 {first}, {own}")
    return page.call("llvm.umin.i32", "i32", [("i32", number), ("i32", str(rows - 1))])


class _Block:
    """Writes what the warps of a block do."""

    def __init__(self, play: Play, page: GpuInstructions, lane: str, together: int) -> None:
        """Begin; `lane` is the register with a thread's lane."""
        self._play, self._page, self._lane, self._together = play, page, lane, together
        self._network = play.network
        self._layers = play.network.layers
        (self._tanh,) = scalarize(jax.make_jaxpr(jnp.tanh)(jax.ShapeDtypeStruct((), jnp.float32)))[0].flat
        (self._z,) = (e for e in in_order([self._tanh]) if isinstance(e, Input))

    def copy_parameters(self, warp: str, element: Callable[[str], Element]) -> None:
        """Write how parameters come into the block's memory: each warp copies those of some episodes."""
        page = self._page
        warps = warps_for(self._together)

        def of_one(turn: str) -> list[str]:
            mine = page.put(f"add i32 {warp}, {page.put(f'mul i32 {turn}, {warps}')}")
            own = page.call("llvm.umin.i32", "i32", [("i32", mine), ("i32", str(self._together - 1))])
            of, to = element(own), self._words(own)

            def copy(count: int, source: int, place: Callable[[str], str]) -> None:
                def one(turn: str) -> list[str]:
                    number = page.put(f"add i32 {page.put(f'mul i32 {turn}, {BLOCK}')}, {self._lane}")
                    number = page.call("llvm.umin.i32", "i32", [("i32", number), ("i32", str(count - 1))])
                    parameter = Input(FLOAT, len(self._play.state), 0)
                    value = of.load(parameter, page.put(f"add i32 {number}, {source}"))
                    self._put(value, to, place(number))
                    return []

                repeat(page, "0", str(-(-count // BLOCK)), [], one)
                of.forget()

            for layer in self._layers:
                copy(layer.inputs * layer.width, layer.start, partial(self._place_of_weight, layer))
                copy(layer.width, layer.start + layer.inputs * layer.width, partial(self._place_after, layer.biases))
            return []

        repeat(page, "0", str(-(-self._together // warps)), [], of_one)

    def step(self, own: str, element: Element, inside: str) -> None:
        """Write what the first warp does: the steps of an episode in each lane; `own` is its number in the block."""
        page, play = self._page, self._play
        arrays = [
            [Input(number.dtype, array, place) for place, number in enumerate(numbers.flat)]
            for array, numbers in enumerate(play.state)
        ]
        before = [number for numbers in arrays for number in numbers]
        after = [number for numbers in play.state for number in numbers.flat]
        words = self._words(own)
        seen, acted = self._signal(words, 0), self._signal(words, len(self._layers))

        def round_(registers: list[str]) -> list[str]:
            state = {(n.array, n.place): register for n, register in zip(before, registers, strict=True)}
            for place in range(self._network.widths[0]):
                self._put(state[0, place], seen, str(place))
            self.wait()
            self.wait()  # meanwhile others act

            def load(number: Input) -> str:
                if number.array < len(arrays):
                    return state[number.array, number.place]
                if number.array == len(arrays):
                    return self._get(acted, str(number.place))
                return element.load(number)

            element.forget()
            made: dict[int, str] = {}
            page.compute(in_order(after), made, load)
            return [page.operand(number, made) for number in after]

        types = [TYPES[number.dtype.kind] for number in before]
        registers = page.repeat("{}.step", play.steps, types, [element.load(number) for number in before], round_)
        page.write(f"br i1 {inside}, label %store, label %done")
        page.label("store")
        element.forget()
        for number, register in zip(before, registers, strict=True):
            result = play.written.index(number.array)
            element.store(register, number.dtype.kind, result, number.place, len(arrays[number.array]))
        page.write("br label %done")

    def act(self, warp: str) -> None:
        """Write what the other warps do: the actions of some episodes each, a neuron in each lane, or several."""
        page, warps = self._page, warps_for(self._together) - 1
        firsts = range(0, self._together, warps)
        words = [self._words(page.put(f"add i32 {warp}, {first - 1}")) for first in firsts]

        def round_(_: list[str]) -> list[str]:
            self.wait()
            for depth, layer in enumerate(self._layers):
                if depth:
                    page.call("llvm.nvvm.bar.warp.sync", "void", [("i32", "-1")])
                for of_one in words:
                    self._dense(layer, of_one, self._signal(of_one, depth), self._signal(of_one, depth + 1))
            self.wait()
            return []

        page.repeat("{}.act", self._play.steps, [], [], round_)
        page.write("br label %done")

    def _dense(self, layer: Layer, words: str, given: str, made: str) -> None:
        """Write a layer of one episode; `given` and `made` are the addresses of what it gets and makes."""
        page = self._page
        for begin in range(0, layer.width, BLOCK):
            neuron = page.put(f"add i32 {self._lane}, {begin}")
            own = page.call("llvm.umin.i32", "i32", [("i32", neuron), ("i32", str(layer.width - 1))])
            weights = self._word(words, self._place_after(layer.at, page.put(f"mul i32 {own}, {layer.stride}")))
            sums: list[str] = []
            for place in range(0, layer.inputs, QUAD):
                count = min(QUAD, layer.inputs - place)
                pairs = zip(self._numbers(weights, place, count), self._numbers(given, place, count), strict=True)
                for at, (weight, signal) in enumerate(pairs):
                    if place:
                        sums[at] = self._fma(weight, signal, sums[at])
                    else:
                        sums.append(page.put(f"fmul float {weight}, {signal}"))
            sums.append(self._get(words, self._place_after(layer.biases, own)))
            while len(sums) > 1:
                one, other, *rest = sums
                sums = [*rest, page.put(f"fadd float {one}, {other}")]
            registers = {id(self._z): sums[0]}
            page.compute(in_order([self._tanh]), registers, lambda _: "")
            self._put(page.operand(self._tanh, registers), made, neuron)

    def _numbers(self, address: str, place: int, count: int) -> list[str]:
        """Return the registers of some numbers one after the other, which begin at a whole quad."""
        page = self._page
        if count < QUAD:
            return [self._get(address, str(place + at)) for at in range(count)]
        where = self._word(address, str(place))
        quad = page.put(f"load <{QUAD} x float>, ptr addrspace(3) {where}, align {BYTES['f'] * QUAD}")
        return [page.put(f"extractelement <{QUAD} x float> {quad}, i32 {at}") for at in range(QUAD)]

    def _words(self, episode: str) -> str:
        """Return the address of an episode's part of the block's memory."""
        begin = self._page.put(f"mul i32 {episode}, {self._network.words}")
        return self._word("@numbers", begin)

    def _signal(self, words: str, depth: int) -> str:
        """Return the address of what so many layers have made; of none, of what is observed.

        That has a place of its own: a lane may write it again while another still reads the action.
        """
        place = 2 - depth % 2 if depth else 0
        return self._word(words, str(self._layers[-1].end + place * self._network.room))

    def _get(self, address: str, place: str) -> str:
        return self._page.put(f"load float, ptr addrspace(3) {self._word(address, place)}, align {BYTES['f']}")

    def _put(self, value: str, address: str, place: str) -> None:
        self._page.write(f"store float {value}, ptr addrspace(3) {self._word(address, place)}, align {BYTES['f']}")

    def _word(self, address: str, place: str) -> str:
        return self._page.put(f"getelementptr i32, ptr addrspace(3) {address}, i32 {place}")

    def _place_of_weight(self, layer: Layer, number: str) -> str:
        page = self._page
        neuron, of = (page.put(f"{divided} i32 {number}, {layer.inputs}") for divided in ("udiv", "urem"))
        return self._place_after(layer.at, page.put(f"add i32 {page.put(f'mul i32 {neuron}, {layer.stride}')}, {of}"))

    def _place_after(self, begin: int, number: str) -> str:
        return self._page.put(f"add i32 {number}, {begin}")

    def _fma(self, a: str, b: str, c: str) -> str:
        return self._page.call("llvm.fma.f32", "float", [("float", each) for each in (a, b, c)])

    def wait(self) -> None:
        """Write a barrier: all warps of the block wait for each other."""
        self._page.call("llvm.nvvm.barrier0", "void", [])


def _rounded_up(count: int, of: int) -> int:
    return -(-count // of) * of
