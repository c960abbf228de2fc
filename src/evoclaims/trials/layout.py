"""How the trials of a batch are laid out on devices, and all that follows from it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import Enum
from functools import wraps
from typing import Any, Final

import jax
import jax.numpy as jnp

from evoclaims.methods.base import Resizable
from evoclaims.trials.devices import usable_cores
from evoclaims.trials.program import Program
from evoclaims.trials.spec import Condition

SHORT: Final = 100_000
"""On a CPU, trials of up to so many environment steps are compiled fast rather than run fast."""

FAST_TO_COMPILE: Final = {"xla_backend_optimization_level": 1, "xla_llvm_disable_expensive_passes": True}

SIDE_BY_SIDE: Final = {"xla_gpu_command_buffer_scheduling_mode": "CONCURRENT"}
"""Small kernels that do not need each other run at the same time: a step of PPO on the gates takes 0.6 of the time."""

BRIEF: Final = 100_000
"""Environment steps of a generation of NEAT: of fewer, it mostly waits for the host, which reads the conditions of its
loops. With 65,536 it gains by loops on the GPU, with 320,000 it loses; between them nothing was measured."""

LOOPS_ON_GPU: Final = {
    # XLA's own choice, and the last two
    "xla_gpu_enable_command_buffer": "FUSION,CUBLAS,CUBLASLT,CUSTOM_CALL,CUDNN,DYNAMIC_SLICE_FUSION,CONDITIONAL,WHILE"
}
"""The GPU reads conditions itself. Not with `SIDE_BY_SIDE`: such programs have hung."""


class Layout(Enum):
    """Whether each trial is a call of its own, or trials run side by side in a call.

    On a CPU, whose cores other trials fill, a call of its own costs nothing, a trial's bits do not depend on other
    trials, and a trial that has ended costs nothing. On an accelerator a step's time is mostly kernel launches, which
    trials side by side share.
    """

    ALONE = "alone"
    VECTOR = "vector"

    @property
    def alone(self) -> bool:
        """Whether a trial is a call of its own: its bits depend on no other, and its work is that of a core."""
        return self is Layout.ALONE

    def over_trials(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Batch a single-trial function over a leading axis of all its arguments, of length one if trials are alone."""
        return _alone(function) if self.alone else jax.vmap(function)

    def advance(self, program: Program) -> Callable[..., Any]:
        """Return what advances trials, leaves [trials]."""
        return self.over_trials(program.advance) if self.alone else program.advance_together

    def options(self, condition: Condition) -> dict[str, Any] | None:
        """Return the compiler options; they depend only on condition and layout, so that bits do, too."""
        if not self.alone:
            brief = isinstance(condition.method, Resizable) and condition.cost < BRIEF
            return LOOPS_ON_GPU if brief else SIDE_BY_SIDE
        return FAST_TO_COMPILE if condition.environment_steps <= SHORT else None

    def width(self, active: int, full: int, devices: int) -> int:
        """Return the number of lanes for `active` of `full` trials: side by side, `full` halved while they fit.

        It depends only on these counts, so that a resumed run uses the same programs. Alone, idle lanes cost nothing.
        """
        if self.alone:
            return full
        lanes, used = full, min(devices, full)
        while lanes > 1 and active <= lanes // 2:
            lanes = -(-lanes // 2)
        return -(-lanes // used) * used

    def homes(self, width: int, devices: Sequence[jax.Device]) -> Sequence[jax.Device]:
        """Return the device of each call, which all have equally many of the lanes; a CPU is one device."""
        if self.alone:
            return [devices[0]] * width
        return devices[: max(count for count in range(1, len(devices) + 1) if width % count == 0)]

    def threads(self, devices: int) -> int:
        """Return how many calls run at a time on so many devices."""
        return usable_cores() if self.alone else devices

    def calls(self, trials: int) -> int:
        """Return how many calls so many trials on one device take."""
        return trials if self.alone else 1


def layout_on(platform: str) -> Layout:
    """Return how trials are laid out on devices of a platform, such as "cpu"."""
    return Layout.ALONE if platform == "cpu" else Layout.VECTOR


def _alone(function: Callable[..., Any]) -> Callable[..., Any]:
    @wraps(function)
    def of_one(*arguments: Any) -> Any:
        trial = jax.tree.map(lambda leaf: jnp.squeeze(leaf, 0), arguments)
        return jax.tree.map(lambda leaf: leaf[None], function(*trial))

    return of_one
