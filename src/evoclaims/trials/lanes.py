"""A batch of trials in compiled programs: one lane per trial, and an independent program for each device.

No program spans devices, so nothing must be partitioned. On a CPU each trial is its own call, and as many run at a
time as there are cores; on accelerators each device runs its share of the lanes side by side.
"""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import jax
import numpy as np
from jax.sharding import SingleDeviceSharding

from evoclaims.core.waiting import working_time
from evoclaims.trials.devices import MATMUL_PRECISION, give_back
from evoclaims.trials.layout import layout_on
from evoclaims.trials.program import Program, Report, Score, TrialState
from evoclaims.trials.spec import Condition

Shares = tuple[TrialState, ...]
"""The states of a batch, leaves [lanes of the share]: each share is on one device, and one call advances it."""


@dataclass(frozen=True)
class Compiled:
    """The programs of a condition for one share of the lanes.

    Attributes:
        advance, examine: compiled; all arguments and results have a leading axis [lanes of the share].
    """

    advance: Callable[..., tuple[TrialState, Report]]
    examine: Callable[..., Score]


class Lanes:
    """Compiles a condition's programs for given devices, at most once per share size and device, and runs them.

    Attributes:
        condition: the condition to compile.
        devices: where it runs.
        layout: how trials are laid out on them.
        seconds: spent on compiling so far.
    """

    def __init__(self, condition: Condition, devices: Sequence[jax.Device]) -> None:
        """Store the condition and the devices; nothing is compiled yet."""
        self.condition = condition
        self.devices = list(devices)
        self.layout = layout_on(self.devices[0].platform)
        self.seconds = 0.0
        self._program = Program(condition)
        self._compiled: dict[tuple[int, jax.Device], Compiled] = {}

    def width(self, active: int, full: int) -> int:
        """Return the number of lanes for `active` of `full` trials."""
        return self.layout.width(active, full, len(self.devices))

    def programs(self, width: int) -> list[Compiled]:
        """Return the programs of each share of `width` lanes, compiling missing ones."""
        size, homes = self._shares(width)
        missing = [home for home in dict.fromkeys(homes) if (size, home) not in self._compiled]
        if missing:
            began = working_time()
            self._compiled.update({(size, home): made for home, made in self._compile(size, missing).items()})
            give_back()  # what compiling has freed, or the trials' memory comes on top of it
            self.seconds += working_time() - began
        return [self._compiled[size, home] for home in homes]

    def shapes(self, lanes: int) -> Any:
        """Return shapes and dtypes of the state of `lanes` lanes, as `gather` returns it."""
        with self._settings():
            one = jax.eval_shape(self.layout.over_trials(self._program.start), *_seeds(1))
        return jax.tree.map(lambda leaf: jax.ShapeDtypeStruct((lanes, *leaf.shape[1:]), leaf.dtype), one)

    def place(self, tree: Any, width: int) -> tuple[Any, ...]:
        """Split a tree of host arrays with leading axis [width] into shares, each on its device."""
        leaves, structure = jax.tree.flatten(tree)
        size, homes = self._shares(width)
        shares = [[leaf[first : first + size] for leaf in leaves] for first in range(0, width, size)]
        placed = zip(shares, homes, strict=True)
        return tuple(jax.device_put(jax.tree.unflatten(structure, share), home) for share, home in placed)

    @staticmethod
    def gather(shares: Sequence[Any]) -> Any:
        """Undo `place`: join the shares into one tree with leading axis [width], on the host."""
        return jax.tree.map(lambda *leaves: np.concatenate(leaves), *jax.device_get(list(shares)))

    def start(self, seeds: Sequence[int | None], width: int) -> Shares:
        """Start one trial per lane; None makes an idle lane."""
        known = np.array([0 if seed is None else seed for seed in seeds], np.int32)
        idle = np.array([seed is None for seed in seeds])
        size, homes = self._shares(width)
        distinct = list(dict.fromkeys(homes))
        began = working_time()
        with self._settings():
            start = self.layout.over_trials(self._program.start)
            lowered = [self._lowered(start, home, _seeds(size)) for home in distinct]
            starts = dict(zip(distinct, self._side_by_side(self._finished, lowered), strict=True))
        give_back()
        self.seconds += working_time() - began
        return tuple(starts[home](*share) for home, share in zip(homes, self.place((known, idle), width), strict=True))

    def advance(self, state: Shares, until: int, width: int) -> tuple[Shares, Report]:
        """Advance trials to their ends or to `until` steps; `state` is donated. The report is on the host.

        Side by side, those on a device stop when one of them ends; they go on when it has been made idle.
        """

        def one(program: Compiled, share: TrialState, bound: Any) -> tuple[TrialState, Report]:
            share, report = program.advance(share, bound)
            return share, jax.device_get(report)

        bounds = self.place(np.full(width, until, np.int32), width)
        advanced = self._side_by_side(one, self.programs(width), state, bounds)
        return tuple(share for share, _ in advanced), self.gather([report for _, report in advanced])

    def examine(self, state: Shares, width: int) -> Score:
        """Examine every lane's champion; the result is on the host."""
        scores = self._side_by_side(
            lambda program, share: jax.device_get(program.examine(share)), self.programs(width), state
        )
        score: Score = self.gather(scores)
        return score

    def with_idle(self, state: Shares, idle: Sequence[bool]) -> Shares:
        """Make lanes idle."""
        marks = self.place(np.array(idle), len(idle))
        return tuple(dataclasses.replace(share, idle=mark) for share, mark in zip(state, marks, strict=True))

    def arrangement(self, active: Sequence[int], width: int) -> list[int | None]:
        """Deal active lanes to the shares in turn, so that all shares have about equal work."""
        size, homes = self._shares(width)
        hands = [list(active[share :: len(homes)]) for share in range(len(homes))]
        return [lane for hand in hands for lane in [*hand, *[None] * (size - len(hand))]]

    def _shares(self, width: int) -> tuple[int, Sequence[jax.Device]]:
        """Return the number of lanes per share, which one call advances, and the device of each share."""
        homes = self.layout.homes(width, self.devices)
        return width // len(homes), homes

    def _side_by_side(self, function: Callable[..., Any], *arguments: Sequence[Any]) -> list[Any]:
        """Call the function for all shares, on one thread per core or device; jax releases the interpreter lock."""
        with ThreadPoolExecutor(self.layout.threads(len(self.devices))) as pool:
            calls = [pool.submit(function, *each) for each in zip(*arguments, strict=True)]
            try:
                return [call.result() for call in calls]
            except BaseException:  # an interrupt must not wait for trials not yet begun
                pool.shutdown(wait=False, cancel_futures=True)
                raise

    @staticmethod
    @contextmanager
    def _settings() -> Iterator[None]:
        with jax.default_matmul_precision(MATMUL_PRECISION), warnings.catch_warnings():
            # A kill can damage an entry of jax's cache; jax recompiles it and warns, which must not fail in pytest.
            warnings.filterwarnings("ignore", "Error (reading|writing) persistent compilation cache")
            yield

    def _lowered(self, function: Callable[..., Any], home: jax.Device, arguments: Any, donate: bool = False) -> Any:
        """Trace a function of the lanes of a share on a device; `arguments` are shapes and dtypes."""
        place = SingleDeviceSharding(home)
        placed = jax.tree.map(lambda leaf: jax.ShapeDtypeStruct(leaf.shape, leaf.dtype, sharding=place), arguments)
        return jax.jit(function, donate_argnums=(0,) if donate else ()).lower(*placed)

    def _finished(self, lowered: Any) -> Any:
        return lowered.compile(self.layout.options(self.condition))

    def _compile(self, size: int, homes: Sequence[jax.Device]) -> dict[jax.Device, Compiled]:
        """Compile the repeated programs ahead of time, to measure compile time and run time separately."""
        state, until = self.shapes(size), _seeds(size)[0]
        advance, examine = self.layout.advance(self._program), self.layout.over_trials(self._program.examine)
        with self._settings():
            lowered = [
                program
                for home in homes
                for program in (
                    self._lowered(advance, home, (state, until), donate=True),
                    self._lowered(examine, home, (state,)),
                )
            ]
            give_back()  # what compiling the kernels has freed
            # XLA compiles without the interpreter lock, so two programs take the time of one.
            with ThreadPoolExecutor() as pool:
                made = list(pool.map(self._finished, lowered))
        return {home: Compiled(*made[2 * place : 2 * place + 2]) for place, home in enumerate(homes)}


def picked(state: TrialState, lanes: Sequence[int | None]) -> TrialState:
    """Return the given lanes of a batch's state on the host, in this order; None makes an idle lane."""
    spare = next(lane for lane in lanes if lane is not None)
    order = np.array([spare if lane is None else lane for lane in lanes])
    held: TrialState = jax.tree.map(lambda leaf: np.asarray(leaf)[order], state)
    return dataclasses.replace(held, idle=held.idle | np.array([lane is None for lane in lanes]))


def _seeds(lanes: int) -> tuple[jax.ShapeDtypeStruct, jax.ShapeDtypeStruct]:
    """Return shapes and dtypes of seeds and idle marks, leaves [lanes]."""
    return jax.ShapeDtypeStruct((lanes,), np.int32), jax.ShapeDtypeStruct((lanes,), np.bool_)
