"""Trial results made by hand, for the tests of the store."""

from __future__ import annotations

import functools
import json
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_trials import sound

from evoclaims.core.canonical import content_hash
from evoclaims.trials.arrays import pack
from evoclaims.trials.result import Status, TrialResult
from evoclaims.trials.store import Store

METRICS = {
    "mean_success": 0.75,
    "last_success": 0.5,
    "last_fitness": -0.5,
    "furthest_solved": 0.0,
    "furthest_reached": 1.0,
    "steps": 4.0,
    "environment_steps": 40.0,
}
"""What every trial has measured that has come to its end."""

PARAMETERS = {"layer_0/kernel": np.arange(6, dtype=np.float32).reshape(2, 3), "bias": np.asarray(0.5, np.float32)}
"""Of its champion: its digest is of these, too."""


def _make_result(
    seed: int = 0,
    status: Status = "done",
    metrics: Mapping[str, float] | None = None,
    levels: Mapping[str, tuple[float, ...]] | None = None,
    curves: Mapping[str, tuple[float, ...]] | None = None,
    method: str = "an_algorithm",
    champion: Mapping[str, Any] | None = None,
) -> TrialResult:
    """Return a sound result of a method that is a name alone, with the champion `parameters` or another one."""
    condition = {"engine": 1, "method": {"name": method, "revision": 1, "parameters": {"rate": 0.1}}}
    return sound(
        {**condition, "seed": seed},
        status=status,
        metrics={**METRICS, **(metrics or {})},
        levels={"success": (1.0, 0.5), "fitness": (0.0, -0.5), **(levels or {})},
        curves={"best": (0.25, 0.75)} if curves is None else curves,
        champion=pack(PARAMETERS if champion is None else champion) if champion != {} else b"",
        timing={"run": 1.5, "compile": 0.5, "batch": 3, "started": "2025-01-01T00:00:00+00:00"},
        provenance={"git": None, "versions": {"numpy": "2.0"}},
    )


def _edit_record(path: Path, reseal: bool = True, **fields: Any) -> None:
    """Change fields of a record file by hand; with `reseal` as one who knows how the seal is made."""
    plain = json.loads(path.read_text())
    plain.update(fields)
    if reseal:
        plain["seal"] = content_hash({key: value for key, value in plain.items() if key != "seal"})
    path.write_text(json.dumps(plain))


@pytest.fixture(scope="session")
def make_result() -> Callable[..., TrialResult]:
    """A function that makes a sound result; see `_make_result`."""
    return _make_result


@pytest.fixture(scope="session")
def edit_record() -> Callable[..., None]:
    """A function that edits a record file by hand; see `_edit_record`."""
    return _edit_record


@pytest.fixture(scope="session")
def parameters() -> dict[str, Any]:
    """A champion's parameters: a matrix [2, 3] and a scalar."""
    return dict(PARAMETERS)


@pytest.fixture
def store(tmp_path: Path) -> Store:
    """An empty store that no folder exists for yet."""
    return Store(tmp_path / "store")


@pytest.fixture
def trial(store: Store, parameters: dict[str, Any]) -> TrialResult:
    """A trial that `store` holds."""
    result = _make_result()
    store.put(result, parameters)
    return result


@pytest.fixture(scope="session")
def cpus() -> list[Any]:
    """Two CPU devices (tests/conftest.py asks for them)."""
    import jax

    return list(jax.devices("cpu")[:2])


class _Lowered:
    """A program that is compiled once, however often it is asked for."""

    def __init__(self, program: Any) -> None:
        self._program, self._compiled = program, None

    def compile(self, options: Any) -> Any:
        self._compiled = self._compiled or self._program.compile(options)
        return self._compiled


_lowered: dict[Any, _Lowered] = {}
"""The programs of lanes by condition, function, layout, device and shapes."""


@pytest.fixture(scope="module", autouse=True)
def compiled_once() -> Iterator[None]:
    """Trace and compile equal programs once for all tests: most runs here differ in what becomes of them alone."""
    from evoclaims.trials import lanes

    lower, program = lanes.Lanes._lowered, lanes.Program

    def lowered(self: lanes.Lanes, function: Any, home: Any, arguments: Any, donate: bool = False) -> Any:
        key = self.condition, function.__name__, self.layout, home, str(arguments), donate
        if key not in _lowered:
            _lowered[key] = _Lowered(lower(self, function, home, arguments, donate))
        return _lowered[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lanes.Lanes, "_lowered", lowered)
        patch.setattr(lanes, "Program", functools.cache(program))
        yield


@pytest.fixture(scope="session")
def uninterrupted(tmp_path_factory: pytest.TempPathFactory, cpus: list[Any]) -> list[TrialResult]:
    """The climbers' trials from a run that nothing has stopped."""
    from climbers import CLIMBING, SEEDS

    from evoclaims.trials.runner import run

    return run(CLIMBING, SEEDS, Store(tmp_path_factory.mktemp("uninterrupted")), cpus)


@pytest.fixture
def puts(monkeypatch: pytest.MonkeyPatch) -> Counter[int]:
    """How often each seed was put into any store."""
    counts: Counter[int] = Counter()
    put = Store.put

    def counting(self: Store, result: TrialResult, champion: Any) -> Any:
        counts[result.seed] += 1
        return put(self, result, champion)

    monkeypatch.setattr(Store, "put", counting)
    return counts
