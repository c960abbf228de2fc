"""Whole episodes of a perceptron as one kernel of NVIDIA's GPUs; `episode_kernel` writes it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache, cached_property
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array

from evoclaims.kernels.call import calls
from evoclaims.kernels.call.kernel import Kernel, Shapes
from evoclaims.kernels.emit import episode_kernel, gpu_kernel, llvm_ir, machine_code
from evoclaims.kernels.emit.block_kernel import processors_and_memory
from evoclaims.kernels.emit.episode_kernel import Perceptron, Play
from evoclaims.kernels.emit.llvm_ir import BYTES, ArrayRow
from evoclaims.kernels.trace.expressions import Input, Unsupported, everything
from evoclaims.kernels.trace.interpreter import Numbers
from evoclaims.kernels.trace.scalarize import scalarize


class EpisodeKernel(Kernel):
    """What `episode_in_one_kernel` returns, for arguments of given shapes."""

    def __init__(
        self,
        play: Callable[..., Any],
        step: Callable[..., Any],
        steps: int,
        widths: tuple[int, ...],
        name: str,
        given: Any,
    ) -> None:
        """Trace `play`; `given` are the shapes of the arguments."""
        leaves, treedef = jax.tree.flatten(given)
        super().__init__(play, name, treedef, tuple(leaves))
        self._step, self._given = step, given
        self._steps, self._network = steps, Perceptron(widths)

    @cached_property
    def results(self) -> list[Numbers]:
        """The expressions of the numbers of the state after a step, which only a GPU needs."""
        state, parameters, constants = self._given
        action = jax.ShapeDtypeStruct(self._network.widths[-1:], parameters.dtype)
        return scalarize(jax.make_jaxpr(self._step)(state, action, constants))

    @cached_property
    def read(self) -> dict[int, ArrayRow]:
        """The rows of the arguments: of the state and the parameters, and of what else a step depends on."""
        used = {e.array for e in everything(n for r in self.results for n in r.flat) if isinstance(e, Input)}
        used |= {*self.written, len(self.results)}
        return {i: ArrayRow(math.prod(self.shapes[i].shape), self.shapes[i].dtype.kind) for i in sorted(used)}

    @cached_property
    def supported(self) -> bool:
        """Whether steps can be a part of the kernel. Where not, the step's own kernel is better, or says why."""
        try:
            machine_code.lanes()
            numbers = [number for result in self.results for number in result.flat]
            llvm_ir.check(numbers)
        except Unsupported:
            return False
        floats = self.shapes[0].dtype == self.shapes[len(self.results)].dtype == jnp.float32
        # A warp alone computes a small step as fast as several would.
        return floats and self._steps > 0 and len(everything(numbers)) <= gpu_kernel.SMALL

    @property
    def has_effects(self) -> bool:
        """Whether playing does more than to return a state, such as printing: the kernel's call would not say so."""
        return bool(self._traced.effects)

    def on_host(self, *leaves: Array) -> list[Array]:
        """Play as `play` says."""
        return self.as_it_is(*leaves)

    def on_gpu(self, *leaves: Array) -> list[Array]:
        """Play in the kernel, or as `play` says where it cannot be had, or would be slower."""
        rows = math.prod(self.batch(leaves))
        if not rows or not self._together(rows) or not self.supported:
            return self.as_it_is(*leaves)
        return super().on_gpu(*leaves)

    def _together(self, rows: int) -> int:
        """Return how many episodes a block plays; 0 if they do not fit."""
        return episode_kernel.episodes_of_a_block(self._network, rows, *processors_and_memory())

    def _written_for_gpus(self, rows: int, shared: dict[int, int]) -> gpu_kernel.GpuProgram:
        together = self._together(rows)
        play = Play(self._steps, self.results, self._network)
        text = episode_kernel.text(play, self.read, shared, rows, together)
        memory = together * self._network.words * BYTES["f"]
        return gpu_kernel.program(text, self.name, together, episode_kernel.warps_for(together), shared_bytes=memory)


def episode_in_one_kernel(
    play: Callable[..., Any], step: Callable[..., Any], steps: int, widths: Sequence[int], name: str
) -> Callable[..., Any]:
    """Return `play`, run as one kernel on NVIDIA's GPUs where a step is small and all episodes fit at a time.

    All processors play together, as many episodes each as have room for their perceptrons: about a thousand of the
    paper's on an H200. More are played step by step.

    Args:
        play: from a state, a tree of arrays the first of which a perceptron sees, from the perceptron's parameters, and
            from a tree of what no step changes, to the state at the end.
        step: one of its steps: from a state, an action and what no step changes to the next state.
        steps: how many there are.
        widths: of the observation, of the perceptron's dense tanh layers, and of the action. Its parameters are, layer
            by layer, weights [outputs, inputs] and biases.
        name: what it computes, for warnings and profilers.
    """

    @cache
    def kernel(treedef: Any, shapes: Shapes) -> EpisodeKernel:
        return EpisodeKernel(play, step, steps, tuple(widths), name, jax.tree.unflatten(treedef, shapes))

    def run(state: Any, parameters: Array, constants: Any) -> Any:
        leaves, treedef = jax.tree.flatten((state, parameters, constants))
        leaves = [jnp.asarray(leaf) for leaf in leaves]
        made = kernel(treedef, tuple(jax.ShapeDtypeStruct(leaf.shape, leaf.dtype) for leaf in leaves))
        if made.has_effects:
            return play(state, parameters, constants)
        return jax.tree.unflatten(made.structure, calls.CALL.bind(*leaves, kernel=made))

    return run
