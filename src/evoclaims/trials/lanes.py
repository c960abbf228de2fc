"""A batch of trials as one compiled program: one lane per trial, spread over devices."""

from __future__ import annotations

import dataclasses
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, NamedSharding, PartitionSpec

from evoclaims.trials.devices import MATMUL_PRECISION, layout_for
from evoclaims.trials.program import Program, Report, Score, TrialState, over_trials
from evoclaims.trials.spec import Condition

AXIS = "trials"

SHORT: Final = 100_000
"""Environment steps of a trial up to which, on a CPU, compiling fast is worth more than running fast."""

FAST_TO_COMPILE: Final = {"xla_backend_optimization_level": 1, "xla_llvm_disable_expensive_passes": True}


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
        advance, score: compiled; all arguments and results have a leading axis [lanes].
        shapes: shapes and dtypes of the stacked state.
    """

    advance: Callable[..., tuple[TrialState, Report]]
    score: Callable[..., Score]
    shapes: Any


class Lanes:
    """Compiles a condition's programs for given devices, each width at most once.

    Attributes:
        condition: what is compiled.
        devices: where it runs.
        layout: see `program.over_trials`.
        seconds: spent on compiling so far.
    """

    def __init__(self, condition: Condition, devices: Sequence[jax.Device]) -> None:
        """Remember the condition and the devices; nothing is compiled yet."""
        self.condition = condition
        self.devices = list(devices)
        self.layout = layout_for(self.devices)
        self.seconds = 0.0
        self._program = Program(condition)
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
            began = time.perf_counter()
            self._compiled[width] = self._compile(width)
            self.seconds += time.perf_counter() - began
        return self._compiled[width]

    def place(self, tree: Any, width: int) -> Any:
        """Move a tree of host arrays with leading axis [width] onto the devices, lanes spread evenly."""
        return jax.device_put(tree, self._sharding(width))

    def start(self, seeds: Sequence[int | None], width: int) -> TrialState:
        """Start one trial per lane; None makes an idle lane."""
        known = np.array([0 if seed is None else seed for seed in seeds], np.int32)
        idle = np.array([seed is None for seed in seeds])
        began = time.perf_counter()
        with self._settings():
            lowered = self._spread(self._program.start, width).lower(*self.place((known, idle), width))
            compiled = lowered.compile(self._compiler_options)
        self.seconds += time.perf_counter() - began
        state: TrialState = compiled(*self.place((known, idle), width))
        return state

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

    def _sharding(self, width: int) -> NamedSharding:
        """Return the even spread of the leading axis over the mesh."""
        return NamedSharding(self._mesh(width), PartitionSpec(AXIS))

    @staticmethod
    @contextmanager
    def _settings() -> Iterator[None]:
        """Set what the programs are traced and compiled under."""
        with jax.default_matmul_precision(MATMUL_PRECISION), warnings.catch_warnings():
            # A kill can tear an entry of jax's cache: it is compiled anew, which must not become an error in pytest.
            warnings.filterwarnings("ignore", "Error (reading|writing) persistent compilation cache")
            yield

    def _spread(self, function: Callable[..., Any], width: int, donate: bool = False) -> Any:
        """Lay a single-trial function out over lanes and devices, ready to be lowered."""
        laid_out = over_trials(function, self.layout)
        axis = PartitionSpec(AXIS)
        spread = jax.shard_map(laid_out, mesh=self._mesh(width), in_specs=axis, out_specs=axis, check_vma=False)
        return jax.jit(spread, donate_argnums=(0,) if donate else ())

    @property
    def _compiler_options(self) -> dict[str, Any] | None:
        """How to compile; it depends on nothing but the condition and the kind of device, so that bits do not."""
        short = self.layout == "loop" and self.condition.environment_steps <= SHORT
        return dict(FAST_TO_COMPILE) if short else None

    def _compile(self, width: int) -> Compiled:
        """Compile what runs again and again, ahead of time, so that compile time and run time are told apart."""
        sharding = self._sharding(width)

        def shape(leaf: Any) -> jax.ShapeDtypeStruct:
            return jax.ShapeDtypeStruct(leaf.shape, leaf.dtype, sharding=sharding)

        seeds, idle = jax.ShapeDtypeStruct((width,), jnp.int32), jax.ShapeDtypeStruct((width,), jnp.bool_)
        with self._settings():
            shapes = jax.eval_shape(self._spread(self._program.start, width), seeds, idle)
            state = jax.tree.map(shape, shapes)
            lowered = (
                self._spread(self._program.advance, width, donate=True).lower(state, shape(seeds)),
                self._spread(self._program.score, width).lower(state),
            )
            # XLA compiles without holding the interpreter, so that two programs take the time of one.
            with ThreadPoolExecutor() as pool:
                advance, score = pool.map(lambda program: program.compile(self._compiler_options), lowered)
        return Compiled(advance=advance, score=score, shapes=shapes)
