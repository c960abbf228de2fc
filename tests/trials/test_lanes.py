"""Lanes: how many there are, where each lies, and what is compiled for them."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from trial_toys import walk

from evoclaims.trials.lanes import Compiled, Lanes, picked
from evoclaims.trials.layout import Layout
from evoclaims.trials.runner import run
from evoclaims.trials.store import Store

pytestmark = pytest.mark.oldest


@pytest.fixture(scope="module", autouse=True)
def compiled_once() -> None:
    """Nothing is kept here from other tests: what is compiled is counted."""


def _lanes(devices: int, layout: Layout = Layout.VECTOR) -> Lanes:
    """Return lanes over devices that need not exist."""
    lanes = object.__new__(Lanes)
    lanes.devices = [None] * devices  # type: ignore[list-item]
    lanes.layout = layout
    return lanes


counts = st.integers(1, 40)


@given(counts, st.integers(1, 8))
def test_lanes_halve_as_trials_end_on_no_more_devices_than_there_are_trials(full: int, devices: int) -> None:
    used, widths = min(devices, full), [_lanes(devices).width(active, full) for active in range(full + 1)]
    assert widths == sorted(widths)
    for active, width in enumerate(widths):
        assert width % used == 0
        assert max(active, 1) <= width <= full + used - 1
        assert width < 2 * max(active, 1) + used
    assert len(set(widths)) <= full.bit_length() + 1  # so that few are compiled
    alone = _lanes(devices, Layout.ALONE)  # on a CPU every lane is a call of its own on one device
    assert {alone.width(active, full) for active in range(full + 1)} == {full}
    assert len(alone._shares(full)[1]) == full
    assert alone.arrangement(range(full), full) == list(range(full))


@given(st.data(), counts, st.integers(1, 8))
def test_an_arrangement_places_every_active_lane_once_and_loads_devices_evenly(
    data: st.DataObject, full: int, devices: int
) -> None:
    lanes = _lanes(devices)
    active = sorted(data.draw(st.sets(st.integers(0, full - 1), min_size=1)))
    width = lanes.width(len(active), full)
    order = lanes.arrangement(active, width)
    assert len(order) == width
    assert sorted(lane for lane in order if lane is not None) == active
    assert order == lanes.arrangement(active, width)
    used = len(lanes._shares(width)[1])
    assert used == min(devices, full)
    loads = [sum(lane is not None for lane in share) for share in np.array(order, dtype=object).reshape(used, -1)]
    assert max(loads) - min(loads) <= 1


@settings(max_examples=20, deadline=None)
@given(st.lists(st.integers(0, 3) | st.none(), min_size=2, max_size=6).filter(lambda order: set(order) != {None}))
def test_rearranged_lanes_keep_their_state_and_the_others_go_idle(order: list[int | None]) -> None:
    lanes = Lanes(walk(), jax.devices("cpu")[:1])
    program_state = _started()
    moved = lanes.gather(lanes.place(picked(program_state, order), len(order)))
    for place, lane in enumerate(order):
        assert moved.idle[place] == (lane is None)
        if lane is not None:
            assert moved.seed[place] == program_state.seed[lane]
            np.testing.assert_array_equal(moved.method[place], program_state.method[lane])


_cached: list[Any] = []


def _started() -> Any:
    """Return the state of four trials on the host, started once."""
    if not _cached:
        _cached.append(Lanes.gather(Lanes(walk(), jax.devices("cpu")[:1]).start([3, 1, 4, 2], 4)))
    return _cached[0]


@pytest.mark.parametrize("layout", Layout)
def test_each_size_of_a_share_is_compiled_once_a_device_in_a_run(
    layout: Layout, tmp_path: Path, cpus: list[Any], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("evoclaims.trials.lanes.layout_on", lambda platform: layout)
    sizes: Counter[int] = Counter()
    compile_size, finish = Lanes._compile, Lanes._finished
    finished: list[Any] = []

    def spy(self: Lanes, size: int, homes: Sequence[jax.Device]) -> dict[jax.Device, Compiled]:
        sizes.update({size: len(homes)})
        return compile_size(self, size, homes)

    monkeypatch.setattr(Lanes, "_compile", spy)
    monkeypatch.setattr(Lanes, "_finished", lambda self, lowered: finished.append(lowered) or finish(self, lowered))
    with jax.log_compiles(), caplog.at_level(logging.WARNING, "jax"):
        results = run(walk(chance=0.35, hazard=0.04), range(1, 6), Store(tmp_path), cpus)
    assert sizes == ({1: 1} if layout.alone else {3: 2, 1: 2})  # lanes of a share, on how many devices
    assert len(finished) == (1 if layout.alone else 2) + 2 * sizes.total()
    lowered = [r for r in caplog.records if r.getMessage().startswith("Compiling ")]  # lowering, once for all devices
    assert len(lowered) == 1 + 2 * len(sizes), [r.getMessage() for r in lowered]
    assert len({result.metrics["steps"] for result in results}) > 1


def test_a_chunk_moves_nothing_between_host_and_device(cpus: list[Any]) -> None:
    lanes = Lanes(walk(), cpus)
    (state, _), (bound, _) = lanes.start([0, 1], 2), lanes.place(np.full(2, 5, np.int32), 2)
    advance = lanes.programs(2)[0].advance
    with jax.transfer_guard("disallow"):
        state, report = advance(state, bound)
    assert np.asarray(report.steps).tolist() == [5]
    text = advance.as_text()  # type: ignore[attr-defined]
    assert not [word for word in ("callback", "infeed", "outfeed", "send(", "recv(") if word in text]


def test_the_state_given_to_a_chunk_is_donated(cpus: list[Any]) -> None:
    lanes = Lanes(walk(), cpus)
    before = lanes.start([0, 1], 2)
    lanes.advance(before, 1, 2)
    assert all(share.method.is_deleted() for share in before)
