"""A batch of trials as one compiled program: one lane per trial, spread over devices."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, NamedSharding, PartitionSpec
from numpy.typing import NDArray

from evoclaims.trials.devices import MATMUL_PRECISION, layout_for
from evoclaims.trials.program import Program, Report, Score, TrialState, over_trials
from evoclaims.trials.spec import Condition

AXIS = "trials"


def width_for(active: int, devices: int, full: int) -> int:
    """Return the lanes to run `active` trials in: `full` halved while they fit, a multiple of the devices.

    It depends on nothing but these counts, so that a resumed run goes through the same programs.
    """
    lanes = max(full, 1)
    while active <= lanes // 2:
        lanes = -(-lanes // 2)
        if lanes == 1:
            break
    return -(-lanes // devices) * devices


@dataclass(frozen=True)
class Compiled:
    """The programs of a condition for one number of lanes.

    Attributes:
        start, advance, score: compiled; all arguments and results have a leading axis [lanes].
        shapes: shapes and dtypes of the stacked state.
        seconds: what compiling took.
    """

    start: Callable[..., TrialState]
    advance: Callable[..., tuple[TrialState, Report]]
    score: Callable[..., Score]
    shapes: Any
    seconds: float


class Lanes:
    """Compiles a condition's programs for given devices, each width at most once."""

    def __init__(self, condition: Condition, devices: Sequence[jax.Device]) -> None:
        """Remember the condition and the devices; nothing is compiled yet."""
        self.condition = condition
        self.devices = list(devices)
        self.layout = layout_for(self.devices)
        self._compiled: dict[int, Compiled] = {}

    def width(self, active: int, full: int) -> int:
        """Return the number of lanes for `active` of `full` trials.

        In a loop an idle lane costs nothing, so that narrowing would only compile again.
        """
        devices = min(len(self.devices), full)
        return width_for(full if self.layout == "loop" else active, devices, full)

    def programs(self, width: int) -> Compiled:
        """Return the programs for `width` lanes, compiling them the first time."""
        if width not in self._compiled:
            self._compiled[width] = self._compile(width)
        return self._compiled[width]

    def place(self, tree: Any, width: int) -> Any:
        """Move a tree of host arrays with leading axis [width] onto the devices, lanes spread evenly."""
        return jax.device_put(tree, NamedSharding(self._mesh(width), PartitionSpec(AXIS)))

    def start(self, seeds: Sequence[int | None], width: int) -> TrialState:
        """Start one trial per lane; None makes an idle lane."""
        known = np.array([0 if seed is None else seed for seed in seeds], np.int32)
        idle = np.array([seed is None for seed in seeds])
        return self.programs(width).start(*self.place((known, idle), width))

    def advance(self, state: TrialState, until: int, width: int) -> tuple[TrialState, Report]:
        """Take every trial to its end or to `until` steps; `state` is donated. The report is on the host."""
        bound = self.place(np.full(width, until, np.int32), width)
        state, report = self.programs(width).advance(state, bound)
        return state, jax.device_get(report)

    def score(self, state: TrialState, width: int) -> Score:
        """Judge every lane's champion; the result is on the host."""
        score: Score = jax.device_get(self.programs(width).score(state))
        return score

    def rearrange(self, state: TrialState, lanes: Sequence[int | None], width: int) -> TrialState:
        """Build a batch of `width` from the given lanes of `state`, in this order; None makes an idle lane."""
        spare = next(lane for lane in lanes if lane is not None)
        order = np.array([spare if lane is None else lane for lane in lanes])
        host: TrialState = jax.tree.map(lambda leaf: leaf[order], jax.device_get(state))
        idle = np.array([lane is None for lane in lanes])
        placed: TrialState = self.place(dataclasses.replace(host, idle=host.idle | idle), width)
        return placed

    def arrangement(self, active: Sequence[int], width: int) -> list[int | None]:
        """Deal active lanes out to the devices like cards, so that none works while another has nothing to do."""
        devices = self._mesh(width).size
        hands = [list(active[device::devices]) for device in range(devices)]
        return [lane for hand in hands for lane in [*hand, *[None] * (width // devices - len(hand))]]

    def worth_moving(self, active: Sequence[int], lanes: int, width: int) -> bool:
        """Whether to move the active ones of `lanes` lanes: into fewer lanes, or off a device that has more to do."""
        devices = self._mesh(width).size
        loads = np.bincount(np.array(active) * devices // lanes, minlength=devices)
        return width < lanes or (self.layout == "loop" and int(loads.max() - loads.min()) > 1)

    def _mesh(self, width: int) -> Mesh:
        """Return the mesh that `width` lanes are spread over: as many devices as divide it."""
        count = max(n for n in range(1, len(self.devices) + 1) if width % n == 0)
        return Mesh(np.array(self.devices[:count]), (AXIS,))

    def _compile(self, width: int) -> Compiled:
        """Compile the three programs, ahead of time, so that compile time and run time are told apart."""
        program, began = Program(self.condition), time.perf_counter()
        mesh = self._mesh(width)
        lanes = jax.ShapeDtypeStruct((width,), jnp.int32, sharding=NamedSharding(mesh, PartitionSpec(AXIS)))
        flags = jax.ShapeDtypeStruct((width,), jnp.bool_, sharding=lanes.sharding)

        def compiled(function: Callable[..., Any], *arguments: Any, donate: bool = False) -> Any:
            spread = jax.shard_map(
                over_trials(function, self.layout),
                mesh=mesh,
                in_specs=PartitionSpec(AXIS),
                out_specs=PartitionSpec(AXIS),
                check_vma=False,
            )
            jitted = jax.jit(spread, donate_argnums=(0,) if donate else ())
            with jax.default_matmul_precision(MATMUL_PRECISION):
                return jitted.lower(*arguments).compile(), jax.eval_shape(jitted, *arguments)

        start, shapes = compiled(program.start, lanes, flags)
        state = jax.tree.map(lambda x: jax.ShapeDtypeStruct(x.shape, x.dtype, sharding=lanes.sharding), shapes)
        advance, _ = compiled(program.advance, state, lanes, donate=True)
        score, _ = compiled(program.score, state)
        seconds = time.perf_counter() - began
        return Compiled(start=start, advance=advance, score=score, shapes=shapes, seconds=seconds)
